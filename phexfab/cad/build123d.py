"""build123d objects: a tree of labelled, coloured compounds and solids."""

from __future__ import annotations

from typing import TYPE_CHECKING

from phexfab.cad.brep import to_shapes
from phexfab.cad.doctor import require
from phexfab.cad.tree import families
from phexfab.fabrication.parts import Parts

if TYPE_CHECKING:
    from build123d import Compound


def to_build123d(parts: Parts, name: str = "shell") -> Compound:
    """Return the parts as a build123d compound, in mm.

    Parameters
    ----------
    parts : Parts
    name : str
        Label of the root. Its children are labelled ``panels``, ``beams``, ``nodes``, and theirs,
        the solids, by their marks.

    Raises
    ------
    PartError
        If a part cannot be a solid, or marks are not unique.
    MissingLibraryError
        If build123d is missing or broken; the message says how to repair it.
    """
    tree = families(parts)
    b3d = require("build123d")
    branches = []
    for family in tree:
        marks = [mark for mark, _ in family.members]
        colour = b3d.Color(*family.colour)
        shapes = to_shapes([g for _, g in family.members], marks)
        leaves = [
            b3d.Solid(shape, label=mark, color=colour)
            for mark, shape in zip(marks, shapes, strict=True)
        ]
        branches.append(b3d.Compound(label=family.name, children=leaves))
    return b3d.Compound(label=name, children=branches)

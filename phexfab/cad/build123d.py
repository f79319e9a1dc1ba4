"""build123d objects: a tree of labelled, coloured compounds and solids, and locations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from phexfab.cad.brep import to_shapes
from phexfab.cad.doctor import require
from phexfab.cad.tags import frames
from phexfab.cad.tree import chosen, families, geometry, metadata
from phexfab.fabrication.parts import Parts

if TYPE_CHECKING:
    from build123d import Compound, Location


def to_build123d(
    parts: Parts, name: str = "shell", names: Sequence[str] | str | None = None
) -> Compound:
    """Return the parts as a build123d compound, in mm.

    Parameters
    ----------
    parts : Parts
    name : str
        Label of the root. Its children are labelled ``panels``, ``beams``, ``nodes``, and theirs,
        the solids, by their marks; each has the part's ``metadata``.
    names : str or sequence of str, optional
        Marks or families to take; all by default.

    Raises
    ------
    PartError
        If a part cannot be a solid, marks are not unique, or there is no such part.
    MissingLibraryError
        If build123d is missing or broken; the message says how to repair it.
    """
    wanted = set(chosen(parts, names))
    b3d = require("build123d")
    branches = []
    for family in families(parts):
        own = [part for part in family.parts if part.mark in wanted]
        if not own:
            continue
        shapes = to_shapes([geometry(part) for part in own], [part.mark for part in own])
        leaves = []
        for part, shape in zip(own, shapes, strict=True):
            leaf = b3d.Solid(shape, label=part.mark, color=b3d.Color(*family.colour))
            leaf.metadata = metadata(part)
            leaves.append(leaf)
        branches.append(b3d.Compound(label=family.name, children=leaves))
    return b3d.Compound(label=name, children=branches)


def locations(source: Any, names: Sequence[str] | str = "nodes") -> dict[str, Location]:
    """Return the locations of nodes, panels or beams of a build by mark.

    z points out of the shell on the side away from the beams; x is along a panel's longest
    direction, along a beam, or along the first beam at a node (``phexfab.cad.tags.frames``).
    """
    b3d = require("build123d")
    return {
        frame.mark: b3d.Plane(
            frame.origin.tolist(), x_dir=frame.x.tolist(), z_dir=frame.z.tolist()
        ).location
        for frame in frames(source, names)
    }

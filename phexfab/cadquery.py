"""phexfab in CadQuery: ``import phexfab.cadquery`` adds methods; nothing of CadQuery is replaced.

On ``Workplane``: ``phexBuild`` (a build from the wire or face on the stack), ``phexShell`` (its
parts on the stack), ``phexParts`` (parts of a build where they stand), ``phexCopies`` (a copy at
every point), ``phexLocations`` (places on nodes, panels or beams, for ``eachpoint``). On
``Assembly``: ``phexAdd``. The functions ``phex_shell``, ``phex_parts``, ``phex_copies`` and
``phex_locations`` are the same for ``Workplane.invoke``; ``Mark``, ``Family`` and ``Tag`` select
parts, faces and edges. Lengths are in mm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal

from phexfab.cad.cadquery import (
    Known,
    known_as,
    locations,
    remember,
    solids,
    stack_of,
    to_cadquery,
)
from phexfab.cad.doctor import require
from phexfab.cad.tags import plain_tag
from phexfab.cad.tree import parts_of
from phexfab.errors import PhexError
from phexfab.pipeline import Build
from phexfab.scripting import build_on

if TYPE_CHECKING:
    import cadquery as cq
    from cadquery import Assembly, Location, Workplane

    from phexfab.design import Design
else:
    cq = require("cadquery")

__all__ = [
    "Family",
    "Mark",
    "Tag",
    "assembly",
    "locations",
    "phex_build",
    "phex_copies",
    "phex_locations",
    "phex_parts",
    "phex_shell",
    "solids",
]

Names = Sequence[str] | str | None
Combine = bool | Literal["cut", "a", "s"]
Step = Callable[["Workplane"], "Workplane"]


def phex_build(
    workplane: Workplane,
    panel_size: float | str | None = None,
    design: Design | str | PathLike[str] | None = None,
    **tables: Mapping[str, Any] | str,
) -> Build:
    """Return the build on the stack of a workplane: of a closed wire, edges, or a curved face.

    The parameters are those of ``phexfab.scripting.build_on``; any table of a design file may be
    given: ``phex_build(rim, 600, panels={"material": "glass", "thickness": 8})``.
    """
    return build_on(workplane, panel_size, design, **tables)


def phex_shell(
    panel_size: float | str | None = None,
    design: Design | str | PathLike[str] | None = None,
    **tables: Mapping[str, Any] | str,
) -> Step:
    """Return a step that puts the parts of ``phex_build`` on the stack."""

    def step(workplane: Workplane) -> Workplane:
        return stack_of(workplane, phex_build(workplane, panel_size, design, **tables))

    return step


def phex_parts(source: Any, names: Names = None) -> Step:
    """Return a step that puts parts on the stack as solids, where they stand in the shell.

    Parameters
    ----------
    source : a build, or its ``Parts``
    names : str or sequence of str, optional
        Marks or families; all parts by default. They become tags, ``.solids(tag="P017")``, and so
        do the names of faces and edges, ``.faces(tag="top")``.
    """
    return lambda workplane: stack_of(workplane, source, names)


def phex_copies(source: Any, names: Names = None, combine: Combine = False) -> Step:
    """Return a step that puts a compound of parts at every point of the stack.

    Parameters
    ----------
    source : a build, or its ``Parts``
    names : str or sequence of str, optional
        Marks or families; all parts by default.
    combine : bool, "cut", "a" or "s"
        As in ``Workplane.eachpoint``.
    """

    def step(workplane: Workplane) -> Workplane:
        compound = cq.Compound.makeCompound(solids(source, names))
        made: Workplane = workplane.eachpoint(compound, True, combine)
        remember(made, parts_of(source))
        return made

    return step


def phex_locations(source: Any, names: Sequence[str] | str = "nodes") -> Step:
    """Return a step that puts locations on the stack, for ``eachpoint(…, True)``.

    Parameters
    ----------
    source : a build
    names : str or sequence of str
        ``nodes``, ``panels``, ``beams``, or marks. z points out of the shell on the side away from
        the beams; x is along the first beam at a node, a panel's longest direction, or the beam.
    """

    def step(workplane: Workplane) -> Workplane:
        # The stack holds places seen from the workplane; those of the build are the world's.
        here = workplane.plane.location.inverse
        made: Workplane = workplane.newObject([here * place for place in locations(source, names)])
        return made

    return step


def assembly(source: Any, names: Names = None, name: str | None = None) -> Assembly:
    """Return a build as an assembly; see ``phexfab.cad.cadquery.to_cadquery``."""
    given = source.design.name if isinstance(source, Build) else "shell"
    return to_cadquery(parts_of(source), name or given, names)


def phexBuild(
    self: Workplane,
    panelSize: float | str | None = None,
    design: Design | str | PathLike[str] | None = None,
    **tables: Mapping[str, Any] | str,
) -> Build:
    """Return the build on the wire, edges or face on the stack; see ``phex_build``."""
    return phex_build(self, panelSize, design, **tables)


def phexShell(
    self: Workplane,
    panelSize: float | str | None = None,
    design: Design | str | PathLike[str] | None = None,
    **tables: Mapping[str, Any] | str,
) -> Workplane:
    """Put the parts of a shell on the wire, edges or face on the stack; see ``phex_build``."""
    return phex_shell(panelSize, design, **tables)(self)


def phexParts(self: Workplane, source: Any, names: Names = None) -> Workplane:
    """Put parts of a build on the stack, where they stand in the shell; see ``phex_parts``."""
    return phex_parts(source, names)(self)


def phexCopies(
    self: Workplane, source: Any, names: Names = None, combine: Combine = False
) -> Workplane:
    """Put a compound of parts at every point of the stack; see ``phex_copies``."""
    return phex_copies(source, names, combine)(self)


def phexLocations(self: Workplane, source: Any, names: Sequence[str] | str = "nodes") -> Workplane:
    """Put locations of a build on the stack, for ``eachpoint``; see ``phex_locations``."""
    return phex_locations(source, names)(self)


def phexAdd(
    self: Assembly,
    source: Any,
    names: Names = None,
    loc: Location | None = None,
    name: str | None = None,
) -> Assembly:
    """Add a build to an assembly, as ``Assembly.add`` would; see ``assembly``."""
    made: Assembly = self.add(assembly(source, names, name), loc=loc)
    return made


class _Chosen(cq.Selector):
    """Selects by what solids, faces and edges were made as; others are left out."""

    def __init__(self, *names: str) -> None:
        self.names = frozenset(names)

    def filter(self, objectList: Sequence[Any]) -> list[Any]:
        """Return the shapes that are chosen, in order."""
        known = ((shape, known_as(shape)) for shape in objectList)
        return [shape for shape, made in known if made and self.names & self.of(made)]

    def of(self, made: Known) -> frozenset[str]:
        """Return the names that a shape goes by."""
        raise NotImplementedError


class Mark(_Chosen):
    """Selects parts by their marks, and the faces or edges of these.

    ``.solids(Mark("P001", "P002"))``, ``.faces(Mark("P001"))``. A part is known wherever it has
    been moved, and by the faces that were left alone when it was cut.
    """

    def of(self, made: Known) -> frozenset[str]:
        return frozenset([made.mark])


class Family(_Chosen):
    """Selects ``panels``, ``beams`` or ``nodes``, and the faces or edges of these."""

    def of(self, made: Known) -> frozenset[str]:
        return frozenset([made.family])


class Tag(_Chosen):
    """Selects faces and edges by their tags: ``.faces(Tag("mitre-1") & Family("panels"))``.

    The tags are those of ``phexfab.cad.tags.face_tags``; an edge of a part's top or bottom is
    called after both of its faces, ``top_side_1``.
    """

    def __init__(self, *names: str) -> None:
        super().__init__(*map(plain_tag, names))

    def of(self, made: Known) -> frozenset[str]:
        return frozenset(made.tags)


def _install() -> None:
    on_workplane = (phexBuild, phexShell, phexParts, phexCopies, phexLocations)
    methods = [*((cq.Workplane, method) for method in on_workplane), (cq.Assembly, phexAdd)]
    for kind, method in methods:
        present = getattr(kind, method.__name__, method)
        if present.__module__ != __name__:
            raise PhexError(
                f"{kind.__name__}.{method.__name__} already comes from {present.__module__}; "
                "import only one of the two"
            )
    for kind, method in methods:
        setattr(kind, method.__name__, method)


_install()

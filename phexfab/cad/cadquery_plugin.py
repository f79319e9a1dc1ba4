"""A CadQuery plugin: ``import phexfab.cad.cadquery_plugin`` adds two methods to ``Workplane``.

``Workplane.phexParts(build, marks=None)``
    puts parts on the stack, each where it stands in the shell;
``Workplane.phexShell(build, marks=None, combine=False)``
    puts a copy of the shell at every point on the stack, in the workplane's directions.

Both names are new, written the way CadQuery writes them; nothing of CadQuery is replaced.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from phexfab.cad.cadquery import phex_parts, solids
from phexfab.cad.doctor import require
from phexfab.errors import PhexError

if TYPE_CHECKING:
    from cadquery import Workplane

    from phexfab.fabrication.parts import Parts


def phexParts(
    self: Workplane, source: Parts | object, marks: Sequence[str] | str | None = None
) -> Workplane:
    """Put parts on the stack as solids, where they stand in the shell.

    Parameters
    ----------
    source : a build, or its ``Parts``
    marks : str or sequence of str, optional
        Part marks or families; all parts by default.
    """
    return phex_parts(source, marks)(self)


def phexShell(
    self: Workplane,
    source: Parts | object,
    marks: Sequence[str] | str | None = None,
    combine: bool | Literal["cut", "a", "s"] = False,
) -> Workplane:
    """Put a compound of the parts at every point of the stack.

    Parameters
    ----------
    source : a build, or its ``Parts``
    marks : str or sequence of str, optional
        Part marks or families; all parts by default.
    combine : bool, "cut", "a" or "s"
        As in ``Workplane.eachpoint``.
    """
    compound = require("cadquery").Compound.makeCompound(solids(source, marks))
    result: Workplane = self.eachpoint(compound, True, combine)
    return result


def _install() -> None:
    workplane = require("cadquery").Workplane
    for method in (phexParts, phexShell):
        present = getattr(workplane, method.__name__, method)
        if present.__module__ != __name__:
            raise PhexError(
                f"Workplane.{method.__name__} already comes from {present.__module__}; "
                "use Workplane.invoke with phexfab.cad.cadquery.phex_parts instead"
            )
        setattr(workplane, method.__name__, method)


_install()

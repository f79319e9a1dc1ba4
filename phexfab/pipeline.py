"""The walk, on one page: design → surface → shell → parts → checks → files."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import fsum
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phexfab.design import Design, load_design
from phexfab.ending import beam_spec, limits_of, node_spec, panel_spec
from phexfab.fabrication.bars import BeamSpec, beam_drop, down
from phexfab.fabrication.beams import beams
from phexfab.fabrication.checks import check_geometry, check_parts
from phexfab.fabrication.limits import Origin
from phexfab.fabrication.nodes import NodeSpec, nodes
from phexfab.fabrication.panels import PanelSpec, panels
from phexfab.fabrication.parts import CheckResult, Parts, Sheet, Stock
from phexfab.films import rims_given
from phexfab.forming import Form, form, panel_sizes
from phexfab.minimal.shell import surface_distance
from phexfab.parallel.offset import admissible_interval, offset
from phexfab.parallel.shell import Shell
from phexfab.surface import MinimalSurface
from phexfab.surface.freeform.surface import FreeformSurface

if TYPE_CHECKING:
    import build123d
    import cadquery

    from phexfab.cad.scale_model import ScaleModel

Progress = Callable[[str, int, int], None]
DesignLike = Design | str | PathLike[str]
Figures = Mapping[str, tuple[float | int | str, str]]


@dataclass(frozen=True, eq=False)
class Build:
    """A design that has been built: every value on the way, and the files it can become.

    Attributes
    ----------
    design : Design
    surface : MinimalSurface, FreeformSurface or None
        The smooth surface, in mm; None for a mesh from elsewhere.
    shell : Shell
        M and its Gauss image S.
    parts : Parts
    checks : tuple of CheckResult
    figures : mapping of name to (value, unit)

    Examples
    --------
    >>> import phexfab as px
    >>> film = {"name": "enneper", "scale": "3 m"}
    >>> keys = {"surface": film, "lattice": {"panel_size": "50 cm"}}
    >>> made = px.build(px.make_design(keys))
    >>> made.figures["panels"], made.figures["offset type"]
    ((27, ''), ('edge', ''))
    >>> made.offset.mesh.n_faces == made.shell.mesh.n_faces  # the other end of the beams
    True
    """

    design: Design
    surface: MinimalSurface | FreeformSurface | None
    shell: Shell
    parts: Parts
    checks: tuple[CheckResult, ...]
    figures: Figures

    def __repr__(self) -> str:
        made = ", ".join(
            f"{count} {name}" for name in ("panels", "beams", "nodes")
            if (count := len(getattr(self.parts, name)))
        )  # fmt: skip
        failed = [result.name for result in self.checks if not result.ok]
        said = f"{len(failed)} failed: {', '.join(failed)}" if failed else "all pass"
        return f"<Build {self.design.name!r}: {made}; {len(self.checks)} checks, {said}>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the assembly's picture and the verdict."""
        from phexfab.report.notebook import build_html

        return build_html(self)

    @property
    def ok(self) -> bool:
        """True when every check keeps its limit."""
        return all(result.ok for result in self.checks)

    @cached_property
    def offset(self) -> Shell:
        """The parallel shell at the design's offset distance."""
        return offset(self.shell, offset_distance(self.design, self.shell))

    @property
    def stocks(self) -> dict[str, Stock]:
        """Stock sheets of the families ``panels`` and ``beams``."""
        return stocks(self.design)

    @cached_property
    def sheets(self) -> tuple[Sheet, ...]:
        """Stock sheets with all panels and beams nested on them, which takes a while."""
        from phexfab.delivery.job import Job

        return tuple(Job(self, Path(os.devnull), _silent).nested[1])  # no earlier build serves

    def write(self, directory: str | PathLike[str], progress: Progress | None = None) -> Path:
        """Write all files of the build into a folder; it appears whole or not at all.

        Parameters
        ----------
        directory : path
            A folder that an earlier build left there is replaced; its nests are used again where
            the parts have not changed.
        progress : callable, optional
            Called with a stage's name, steps done and steps in all (0 where unknown).

        Raises
        ------
        NestingError, OSError, MissingLibraryError
            If a part does not fit its sheet, a file cannot be written, a library is missing.
        """
        from phexfab.delivery import deliver

        return deliver(self, Path(directory), progress or _silent)

    def export(
        self,
        destination: str | PathLike[str],
        formats: str | Sequence[str] | None = None,
        progress: Progress | None = None,
        *,
        model: ScaleModel | None = None,
    ) -> tuple[Path, ...]:
        """Write chosen files of the build; each appears whole or not at all.

        Parameters
        ----------
        destination : path
            A folder, which is made where it is missing and keeps what else it holds; or a file,
            whose ending then tells the format.
        formats : str or sequence of str
            Some of ``step``, ``step242``, ``glb``, ``ifc``, ``3mf``, ``stl``, ``obj``, ``ply``,
            ``dxf``, ``dxf12``. May be left out for a file.
        progress : callable, optional
            As for ``write``.
        model : ScaleModel, optional
            Scale, printer and wall of ``3mf`` and ``stl``; the design's ``[output]`` otherwise.

        Returns
        -------
        tuple of Path
            The files and folders that were written.

        Raises
        ------
        DesignError, NestingError, OSError, MissingLibraryError
            Likewise, or if a format is unknown.
        """
        from phexfab.delivery import export

        return export(self, Path(destination), formats, progress, model=model)

    def to_cadquery(self) -> cadquery.Assembly:
        """Return a CadQuery assembly ``panels / beams / nodes`` of named, coloured solids."""
        from phexfab.cad.cadquery import to_cadquery

        return to_cadquery(self.parts, self.design.name)

    def to_build123d(self) -> build123d.Compound:
        """Return a build123d compound ``panels / beams / nodes`` of labelled, coloured solids."""
        from phexfab.cad.build123d import to_build123d

        return to_build123d(self.parts, self.design.name)


def build(
    design: DesignLike, progress: Progress | None = None, *, rims: Any = None, face: Any = None
) -> Build:
    """Build a design: its shell, its parts and their checks.

    Parameters
    ----------
    design : Design or path of a design file
    rims : optional
        Boundary curves in place of those that the design names: a ``Rim``, points (n, 3) in mm, a
        CadQuery ``Workplane`` or ``Wire``, a build123d ``Wire``, or a sequence of these.
    face : optional
        A curved face in place of the one that ``surface.step`` names, of CadQuery or build123d.
    progress : callable, optional
        Called with a stage's name, steps done and steps in all (0 where unknown).

    Raises
    ------
    DesignError
        If the design is wrong; the message names key, value and remedy.
    SurfaceError, SolveError
        If the surface is singular in the rectangle of parameters, or a solver fails.

    Examples
    --------
    >>> import phexfab as px
    >>> film = {"name": "enneper", "scale": "3 m"}
    >>> keys = {"surface": film, "lattice": {"panel_size": "50 cm"}}
    >>> made = px.build(px.make_design(keys))  # or the path of a design file
    >>> made.ok, len(made.parts.panels), len(made.parts.beams)
    (True, 27, 101)
    >>> print(f"{max(panel.mass for panel in made.parts.panels):.1f} kg")
    2.7 kg
    """
    say = progress or _silent
    asked = design if isinstance(design, Design) else load_design(design)
    given = () if rims is None else rims_given(rims)
    formed = form(asked, say, given, face)
    shell = formed.shell
    distance = offset_distance(asked, shell)
    offset(shell, distance)  # refuses a distance beyond the limits
    say("parts", 0, 0)
    parts = _parts(asked, shell)
    say("checks", 0, 0)
    limits = limits_of(asked)
    origin = _origin(asked)
    deviation = formed.deviation
    if isinstance(formed.surface, MinimalSurface):
        deviation = surface_distance(formed.surface, shell)
    checks = (
        *check_geometry(
            shell,
            limits,
            surface_distance=deviation,
            offset_distance=distance,
            rim_distance=formed.rim_distance,
            minimal=isinstance(formed.surface, MinimalSurface),
            origin=origin,
        ),
        *check_parts(parts, shell, limits, stocks=stocks(asked), origin=origin),
    )
    figures = _figures(asked, formed, parts, distance)
    return Build(asked, formed.surface, shell, parts, checks, figures)


def check(design: DesignLike, progress: Progress | None = None) -> tuple[CheckResult, ...]:
    """Return the checks of a design; no file is written, a CAD kernel is loaded only to read.

    Parameters
    ----------
    design : Design or path of a design file
    progress : callable, optional
        As for ``build``.

    Returns
    -------
    tuple of CheckResult
        Each with value, limit, unit and the mark of the worst part.

    Raises
    ------
    DesignError, SurfaceError, SolveError
        As ``build``. A check that fails is no error.

    Examples
    --------
    >>> import phexfab as px
    >>> film = {"name": "enneper", "scale": "3 m"}
    >>> keys = {"surface": film, "lattice": {"panel_size": "50 cm"}}
    >>> results = px.check(px.make_design(keys | {"checks": {"shortest_edge": "20 cm"}}))
    >>> [result.name for result in results if not result.ok]
    []
    """
    return build(design, progress).checks


def stocks(design: Design) -> dict[str, Stock]:
    """Return the stock sheets of the families ``panels`` and ``beams``."""
    asked = design.sheets
    return {
        name: Stock(sheet.length, sheet.width, sheet.margin, sheet.spacing)
        for name, sheet in (("panels", asked.panels), ("beams", asked.beams))
    }


def specs(design: Design) -> tuple[PanelSpec, BeamSpec, NodeSpec]:
    """Return what panels, beams and nodes are to be like."""
    return panel_spec(design), beam_spec(design), node_spec(design)


def offset_distance(design: Design, shell: Shell) -> float:
    """Return the design's signed offset distance: the structural depth where none is given."""
    if design.offset.distance is not None:
        return design.offset.distance
    panel, beam, _ = specs(design)
    if design.beams.kind == "none":
        return -down(panel) * panel.thickness
    return down(panel) * (beam_drop(shell, beam, panel) + beam.height)


def _origin(design: Design) -> Origin:
    """Return what the panels come from, for remedies that help there."""
    if design.mesh.method is None:
        return "lattice"
    return "given" if design.mesh.method == "planarise" else "covered"


def _parts(design: Design, shell: Shell) -> Parts:
    panel, beam, node = specs(design)
    if design.beams.kind == "none":
        return Parts(panels(shell, panel), (), nodes(shell, node, beam, panel))
    return Parts(panels(shell, panel), beams(shell, beam, panel), nodes(shell, node, beam, panel))


def _figures(design: Design, formed: Form, parts: Parts, distance: float) -> Figures:
    """Return the key figures of a build, in the order in which they are read."""
    panel, beam, _ = specs(design)
    shell, index = formed.shell, formed.index
    sizes = panel_sizes(shell)
    low, high = admissible_interval(shell)
    size = np.ptp(shell.mesh.vertices, axis=0)
    masses = {
        "panels": fsum(part.mass for part in parts.panels),
        "beams": fsum(part.mass for part in parts.beams),
        "nodes": fsum(part.mass for part in parts.nodes),
    }
    figures: dict[str, tuple[float | int | str, str]] = {
        "panels": (len(parts.panels), ""),
        "beams": (len(parts.beams), ""),
        "nodes": (len(parts.nodes), ""),
        "size x": (float(size[0]), "mm"),
        "size y": (float(size[1]), "mm"),
        "size z": (float(size[2]), "mm"),
        "smallest panel size": (float(sizes.min()), "mm"),
        "median panel size": (float(np.median(sizes)), "mm"),
        "largest panel size": (float(sizes.max()), "mm"),
        "panels off the size asked by more than a factor of 2": (
            int(np.sum(np.abs(np.log2(sizes / design.lattice.panel_size)) > 1)),
            "",
        ),
        "panel area": (fsum(part.area for part in parts.panels) / 1e6, "m²"),
        "beam length": (fsum(part.length for part in parts.beams) / 1e3, "m"),
        **{f"mass of {name}": (value, "kg") for name, value in masses.items()},
        "offset type": (shell.kind, ""),
        "offset distance": (distance, "mm"),
        "offset at least": (low, "mm"),
        "offset at most": (high, "mm"),
        "lattice step": (shell.step, ""),
    }
    if parts.beams:
        figures["beam drop"] = (beam_drop(shell, beam, panel), "mm")
    if index is not None:
        figures["unstable directions of the film"] = (index, "")
    return {**figures, **formed.figures}


def _silent(stage: str, done: int, total: int) -> None:
    """Say nothing: nobody watches."""

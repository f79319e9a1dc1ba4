"""Films: what a design asks for, as a smooth surface beyond its rims, and these as its borders.

Lattices are laid on them in ``phexfab.placing``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.design import Design
from phexfab.design.load import file_of
from phexfab.errors import DesignError, LatticeError, SurfaceError
from phexfab.mesh.trimesh_io import read_triangles
from phexfab.parallel.border import Border
from phexfab.surface import MinimalSurface, associate, from_expressions
from phexfab.surface.catalog import surface as named_surface
from phexfab.surface.disc_films.extension import FILM, extended
from phexfab.surface.disc_films.plateau import DiscFilm, plateau
from phexfab.surface.domain import Disc
from phexfab.surface.mesh_films.atlas import atlas
from phexfab.surface.mesh_films.margin import inward, mesh_film_with_margin
from phexfab.surface.mesh_films.mesh_film import MeshFilm, film_of_mesh, mesh_film, rimmed
from phexfab.surface.panel_sizes import DISC_EDGE, sizes_along_disc, sizes_at_rims
from phexfab.surface.periodic.mesh import periodic_film
from phexfab.surface.rims.checks import unit_factor
from phexfab.surface.rims.inward import rounded_inward
from phexfab.surface.rims.rim import Rim
from phexfab.surface.umbilics import Umbilics, umbilics

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]
Figures = Mapping[str, tuple[float | int | str, str]]

MARGIN = 1.7
"""Panels by which a film reaches beyond its rims: border panels need whole neighbours."""
BLUR = 1e-7
"""Share of a film's Hopf differential that is not its own: it parts umbilics of higher order."""
FINE = 30
"""Edges of a periodic film's mesh along its cell, at least: fewer do not show its umbilics."""
FINER = (1.0, 0.65, 0.45)
"""Edges of that mesh, over the first choice, that are tried where it shows too little."""
ACROSS, COARSEST = 45.0, 2.0
"""Panels across a rim up to which a mesh's edges are as long as they; longest edges, in panels."""
SAMPLES = 24
"""Points of a border per panel along it."""


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane domain of parameters that a film covers.

    Attributes
    ----------
    domain, core : Disc
        All of it, and the part within the rims.
    umbilics : Umbilics
        Of the whole domain.
    """

    domain: Disc
    core: Disc
    umbilics: Umbilics


@dataclass(frozen=True, eq=False)
class Meshed:
    """A triangle mesh that lies on a film.

    Attributes
    ----------
    points, triangles : (n, 3) mm and (m, 3) int
    parameters : (n,) complex
        The surface's.
    bends : (normals, directions, curvatures)
        (n, 3), (n, 3) and (n,): of the film, directions those of the curvature −κ.
    given : bool
        The mesh is the user's, and no finer one can be made.
    """

    points: FloatArray
    triangles: IntArray
    parameters: ComplexArray
    bends: tuple[FloatArray, FloatArray, FloatArray]
    given: bool


@dataclass(frozen=True, eq=False)
class Film:
    """A smooth film that reaches beyond its rims.

    Attributes
    ----------
    surface : MinimalSurface
    ground : Plane or Meshed
        On which lattices are laid.
    borders : tuple of Border
        The rims, where the shell is cut.
    rim_distance : float
        Largest distance of the given rims from the film, mm.
    figures : mapping of name to (value, unit)
    upright : bool
        True where outside means up.
    finer : int
        How many finer meshes there still are to try where this one shows too little.
    """

    surface: MinimalSurface
    ground: Plane | Meshed
    borders: tuple[Border, ...]
    rim_distance: float
    figures: Figures
    upright: bool = False
    finer: int = 0


def film_within(design: Design, rims: Sequence[Rim] = ()) -> DiscFilm | MeshFilm | None:
    """Return the film within the rims of a design, or None where it is known without a search.

    Parameters
    ----------
    design : Design
    rims : sequence of Rim
        Used in place of what ``surface.rim`` names.

    Raises
    ------
    DesignError, SurfaceError
        If a rim cannot be read, or there is no film.
    """
    source = "rim" if rims else design.surface.source
    if source == "rim":
        given = tuple(rims) or rims_asked(design)
        if len(given) == 1:
            return plateau(given[0], tolerance=FILM, free=design.surface.free)
        return _film_between(given, design.lattice.panel_size, design.name)
    return _given_film(design) if source == "mesh" else None


def _film_between(rims: Sequence[Rim], panel_size: float, name: str) -> MeshFilm:
    """Return the film on a mesh as coarse as will do.

    The lattice's error is that of linear elements, (edge / rim)² of the rim's length: to stay the
    same share of a panel, edges need to shrink with the root of the panels' size only.
    """
    rims = tuple(rims)
    across = max(rim.size for rim in rims) / panel_size
    edge = panel_size * float(np.clip(np.sqrt(across / ACROSS), 1.0, COARSEST))
    if edge > panel_size:
        try:
            film = mesh_film(rims, edge, name=name)
        except SurfaceError:
            film = None
        if film is not None and not film.rough:
            return film
    return mesh_film(rims, panel_size, name=name)


def film_of(
    design: Design, within: DiscFilm | MeshFilm | None, reach: float = 1.0, finer: int = 0
) -> Film:
    """Return the film that a design asks for, with a margin beyond its rims.

    Parameters
    ----------
    design : Design
    within : DiscFilm, MeshFilm or None
        From ``film_within``.
    reach : float
        Factor on the margin by which the film reaches beyond its rims.
    finer : int
        Which of the meshes of a periodic surface, coarsest first; see ``Film.finer``.

    Raises
    ------
    DesignError, SurfaceError, LatticeError
    """
    margin = MARGIN * reach * design.lattice.panel_size
    if isinstance(within, DiscFilm):
        return _disc_film(design, within, margin)
    if within is not None:
        return _mesh_film(design, within, margin)
    if design.surface.source == "periodic":
        return _periodic_film(design, margin, finer)
    return _round_piece(design, margin)


def smooth_surface(design: Design) -> MinimalSurface:
    """Return the smooth surface that a design asks for, scaled to mm.

    Raises
    ------
    DesignError
        If the catalog has no such surface or option, or a formula cannot be read.
    """
    asked = design.surface
    options: dict[str, Any] = {
        "order": asked.order,
        "ends": asked.ends,
        "bonnet_angle": asked.bonnet_angle,
    }
    given = {key: value for key, value in options.items() if value is not None}
    try:
        if asked.g is not None and asked.height_differential is not None:
            base = complex(*asked.base)
            made = from_expressions(g=asked.g, dh=asked.height_differential, base=base)
            made = associate(made, given.get("bonnet_angle", 0.0))
        else:
            made = named_surface(str(asked.name), **given)
    except SurfaceError as error:
        key = "surface.name" if asked.name is not None else "surface.g"
        raise DesignError(f"{key}: {error}") from error
    return made.scaled(asked.scale)


def rims_given(thing: Any) -> tuple[Rim, ...]:
    """Return the rims in what a script hands over; see ``phexfab.cad.rims.rims_of``."""
    from phexfab.cad.rims import rims_of

    return rims_of(thing)


def rims_asked(design: Design) -> tuple[Rim, ...]:
    """Return the rims that ``surface.rim`` names; paths start at the design file.

    Raises
    ------
    DesignError
        If a file cannot be read, or what it holds is no rim.
    """
    from phexfab.cad.rims import read_rims, rims_of

    asked = design.surface
    options: dict[str, Any] = {"unit": asked.unit, "smooth": asked.smooth_corners}
    if asked.corner_angle is not None:
        options["corner_angle"] = asked.corner_angle
    found: list[Rim] = []
    for item in asked.rim or ():
        if isinstance(item, str):
            found += read_rims(file_of(design, "surface.rim", item), layer=asked.layer, **options)
        else:
            found += rims_of(np.array(item), name="surface.rim", **options)
    if asked.smooth_inward is not None:
        return rounded_inward(found, asked.smooth_inward)
    return tuple(found)


def _round_piece(design: Design, margin: float) -> Film:
    """The piece |z − centre| ≤ radius of a named surface."""
    smooth, asked = smooth_surface(design), design.surface
    centre, radius = complex(*asked.centre), float(asked.radius or 0.0)
    if not radius > 0:
        raise DesignError("surface.radius = 0: give a radius above 0")
    turn = np.exp(2j * np.pi * np.arange(720) / 720)
    outer = radius
    while outer < 4 * radius:  # walk outwards until the margin is covered everywhere
        width = np.full(len(turn), margin)
        for a in np.linspace(radius, outer, 17)[:-1] + (outer - radius) / 32:
            width = width - smooth.conformal_factor(centre + a * turn) * (outer - radius) / 16
        if np.max(width) <= 0:
            break
        outer *= 1.02
    rim = centre + radius * turn
    border = Border(smooth.point(rim), smooth.normal(rim), np.zeros(0, np.int64))
    domain = Disc(centre, outer)
    ground = Plane(domain, Disc(centre, radius), umbilics(smooth, domain))
    return Film(smooth, ground, (border,), 0.0, {})


def _disc_film(design: Design, film: DiscFilm, margin: float) -> Film:
    rim = film.rim
    # Where a film is flat, as at corners, panels are large.
    margin *= 1.4 if len(rim.corners) else 1.25
    if not margin <= film.surface.scale / 3:
        size = design.lattice.panel_size
        raise LatticeError(
            f"lattice.panel_size = {size:.4g} mm: panels are too large for {rim.name}, a rim of "
            f"{film.surface.scale:.0f} mm; choose {size * film.surface.scale / 3 / margin:.0f} mm "
            "or less"
        )
    wider = extended(film, margin, sizes_along_disc(film))
    domain = wider.domain.widened(DISC_EDGE - 1) if wider.domain.is_round else wider.domain
    z = domain.grid()
    places = wider.surface.point(z)
    border, foot = border_on(wider.surface, rim, places, z, design.lattice.panel_size)
    arm = foot - domain.centre
    if np.angle(np.roll(arm, -1) / arm).sum() < 0:  # z turns as the normals do
        border, _ = border_on(wider.surface, rim.reversed(), places, z, design.lattice.panel_size)
    ground = Plane(domain, wider.core, umbilics(wider.surface, domain, BLUR))
    figures: Figures = {
        "film area": (wider.film.area / 1e6, "m²"),
        "film conformality": (wider.film.conformality, ""),
    }
    return Film(wider.surface, ground, (border,), wider.rim_distance, figures, upright=True)


def _mesh_film(design: Design, film: MeshFilm, margin: float) -> Film:
    wider = mesh_film_with_margin(film, [margin * share for share in sizes_at_rims(film)])
    z = wider.atlas.parameter_of_vertex(np.arange(len(wider.points)))
    borders = []
    for k, rim in enumerate(film.border):
        along = rim if inward(film, k) > 0 else rim.reversed()
        size = design.lattice.panel_size
        borders.append(border_on(wider.surface, along, wider.points, z, size)[0])
    ground = Meshed(wider.points, wider.triangles, z, _bends(wider.surface, z), film.given)
    figures: Figures = {"film area": (film.area / 1e6, "m²"), **_as_curved(design)}
    return Film(wider.surface, ground, tuple(borders), wider.off_rim, figures, upright=True)


def _given_film(design: Design) -> MeshFilm:
    """The film that a triangle mesh stands for: its border is the rim."""
    asked = design.surface
    path = file_of(design, "surface.mesh", str(asked.mesh))
    given = read_triangles(path)
    if asked.unit is not None:
        given = replace(given, vertices=given.vertices * unit_factor(asked.unit, path.name))
    film = film_of_mesh(given, name=path.name)
    angle = {} if asked.corner_angle is None else {"corner_angle": asked.corner_angle}
    return rimmed(film, **angle)


def _periodic_film(design: Design, margin: float, finer: int) -> Film:
    asked, size = design.surface, design.lattice.panel_size
    film = periodic_film(
        str(asked.periodic),
        cell=asked.scale,
        cells=asked.cells,
        edge_length=FINER[finer] * min(size, asked.scale / FINE),
        margin=margin,
    )
    found = atlas(film.points, film.triangles, normals=film.normals, name=film.name)
    z = found.parameter_of_vertex(np.arange(len(film.points)))
    bends = (film.normals, film.directions, film.curvatures)
    ground = Meshed(film.points, film.triangles, z, bends, True)
    borders = tuple(Border(one.points, one.normals, one.corners) for one in film.cut.borders)
    figures: Figures = {"film area": (film.cut.area / 1e6, "m²"), **_as_curved(design)}
    left = len(FINER) - 1 - finer
    return Film(found.surface, ground, borders, 0.0, figures, finer=left)


def _as_curved(design: Design) -> Figures:
    """Say, if it was asked for, that a lattice on a mesh does not even sizes out."""
    said = ("no: on a mesh they follow the curvature", "")
    return {"panel sizes evened out": said} if design.lattice.evenness else {}


def _bends(smooth: MinimalSurface, z: ComplexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return normals, directions of the curvature −κ, and κ at parameters (n,)."""
    q = smooth.hopf(z)
    with np.errstate(all="ignore"):
        along = (smooth.tangent(z) / np.sqrt(q)[:, None]).real
        along /= np.linalg.norm(along, axis=1, keepdims=True)
    along[q == 0] = 0.0
    return smooth.normal(z), along, np.abs(smooth.principal_curvatures(z)[:, 0])


def border_on(
    smooth: MinimalSurface, rim: Rim, points: FloatArray, z: ComplexArray, panel_size: float
) -> tuple[Border, ComplexArray]:
    """Return a rim as a border of the film, and the parameters of its points' feet.

    Parameters
    ----------
    smooth : MinimalSurface
    rim : Rim
        The film lies to its left, seen from the tips of the normals.
    points, z : (n, 3) and (n,)
        Places on the film, with their parameters, from which feet are sought.
    panel_size : float, mm
    """
    count = int(np.clip(np.ceil(SAMPLES * rim.length / panel_size), 64, 20000))
    t, along = rim.samples(count)
    foot = smooth.closest_parameter(along, z[cKDTree(points).query(along)[1]])
    corners = np.flatnonzero(np.isin(t, rim.corners))
    return Border(along, smooth.normal(foot), corners), foot

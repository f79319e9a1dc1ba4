"""Plateau's problem on a triangle mesh: the film between any number of rims, or of a given mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.errors import SurfaceError
from phexfab.linalg import factorise
from phexfab.surface.mesh_films.area import smallest_angle, stiffness
from phexfab.surface.mesh_films.atlas import Atlas
from phexfab.surface.mesh_films.collocation import collocate
from phexfab.surface.mesh_films.descent import PinchError, descend
from phexfab.surface.mesh_films.film_area import heights_over, smooth_area
from phexfab.surface.mesh_films.limit import film_limit
from phexfab.surface.mesh_films.mirror import Held, Mirror, held_border
from phexfab.surface.mesh_films.start import StartMesh, start_mesh
from phexfab.surface.mesh_films.triangulated import border_loops
from phexfab.surface.rims.rim import Rim
from phexfab.surface.weierstrass import MinimalSurface

if TYPE_CHECKING:
    from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class MeshFilm:
    """A film on a triangle mesh whose vertices lie on the smooth film.

    Attributes
    ----------
    name : str
    points : (n, 3) float, in mm
    triangles : (m, 3) int
        Normals point to the side from which they are seen counter-clockwise.
    atlas : Atlas
        The smooth film, one chart per vertex.
    rims : tuple of Rim
        The rims that were given; none for a film given as a mesh.
    border : tuple of Rim
        The rims that end the mesh: the given ones, or what lies a margin beyond.
    rim_of : (n,) int
        Which rim of the border a fixed vertex lies on; -1 for all others.
    parameter : (n,) float
        The parameter there; nan for all others.
    held : Held
        Which vertices are fixed, and in which mirrors others slide.
    area : float
        Of the smooth film inside the border, mm².
    gradient : float
        What the area's slope was brought down to: along a vertex' line, over half its ring.
    defect : float
        The largest distance between a vertex and the minimal surface around it, over an edge.
    moved : float
        How far vertices of least area were from the smooth film, mm.
    smallest_angle : float
        Of all triangles, degrees.
    off_rim : float
        The largest distance between the given rims and the film, mm; 0 with mirrors.
    steps : int
        Of descent and collocation together.
    unstable : int
        Number of independent ways in which the film would fall to less area; 0 for soap.
    rough : int
        Number of vertices about which the film is not smooth at the size of the mesh, as at
        re-entrant corners; normals and curvatures there are of first order or none.
    given : bool
        True for the film of a given mesh: its shape cannot be made anew from its rims.
    """

    name: str
    points: FloatArray
    triangles: IntArray
    atlas: Atlas
    rims: tuple[Rim, ...]
    border: tuple[Rim, ...]
    rim_of: IntArray
    parameter: FloatArray
    held: Held
    area: float
    gradient: float
    defect: float
    moved: float
    smallest_angle: float
    off_rim: float
    steps: int
    unstable: int
    rough: int
    given: bool = False

    @property
    def surface(self) -> MinimalSurface:
        """The smooth film."""
        return self.atlas.surface

    def border_loops(self) -> list[IntArray]:
        """Return the closed border curves as vertex indices, triangles on their left."""
        return border_loops(self.triangles, self.points)


def mesh_film(
    rims: tuple[Rim, ...], edge: float, *, mirrors: tuple[Mirror, ...] = (), name: str = "film"
) -> MeshFilm:
    """Return the film of least area between rims: a disc, an annulus, a sphere with holes.

    Parameters
    ----------
    rims : tuple of Rim
        All that bound the film.
    edge : float
        Length of the mesh's edges, mm, about.
    mirrors : tuple of Mirror
        Planes that the film meets at right angles: sides of rims that lie in one are free there.
    name : str

    Raises
    ------
    SurfaceError
        If the film pinches, as between rims that are too far apart; the message gives the
        distance at which it still exists. If there is no first mesh, or the mesh is too coarse.

    References
    ----------
    Pinkall, Polthier (1993); Brakke (1992), see `phexfab.surface.mesh_films.area`.

    Examples
    --------
    >>> import numpy as np
    >>> import phexfab as px
    >>> t = 2 * np.pi * np.arange(24) / 24
    >>> ring = 2000 * np.stack([np.cos(t), np.sin(t), 0 * t], axis=-1)  # mm
    >>> rims = (px.Rim.through(ring), px.Rim.through(ring[::-1] + [0, 0, 1000]))
    >>> film = px.mesh_film(rims, edge=300.0)  # a catenoid
    >>> print(f"{film.area / 1e6:.2f} m², {film.unstable} unstable directions")
    12.43 m², 0 unstable directions
    """
    rims = tuple(rims)
    start = start_mesh(rims, edge)
    held = held_border(start.points, start.triangles, mirrors)
    try:
        return _finished(start, held, name, True, rims)
    except PinchError as error:
        raise SurfaceError(f"{error}; {_remedy(rims, mirrors)}") from error


def film_of_mesh(
    mesh: PolyMesh,
    *,
    mirrors: tuple[Mirror, ...] = (),
    name: str = "film",
    stable: bool = True,
) -> MeshFilm:
    """Return the film with the border and the topology of a given triangle mesh.

    Parameters
    ----------
    mesh : PolyMesh
        Of triangles only, consistently oriented; `phexfab.mesh.trimesh_io.read_triangles` sees to
        both. Its border stays where it is.
    mirrors : tuple of Mirror
        Border edges that lie in one of these planes slide in it, and the film meets it at right
        angles.
    name : str
    stable : bool
        False: find the minimal surface next to the mesh even if soap would leave it.

    Raises
    ------
    MeshError
        If the mesh is not a manifold.
    SurfaceError
        If a face is no triangle, the mesh has no border, or the film pinches.

    Examples
    --------
    >>> import phexfab as px
    >>> cell = px.periodic_film("schwarz-p", cell=1000.0, edge_length=150.0).cut  # mm
    >>> mesh = px.PolyMesh.from_faces(cell.points, cell.triangles)
    >>> film = px.film_of_mesh(mesh)
    >>> len(film.border_loops())
    6
    """
    points = np.asarray(mesh.vertices, float)
    if mesh.n_faces == 0 or (mesh.sides != 3).any():
        worst = int(np.argmax(mesh.sides != 3)) if mesh.n_faces else 0
        raise SurfaceError(
            f"{name}: face {worst} is no triangle; read the file with read_triangles, which "
            "splits what can be split"
        )
    triangles = mesh.corners.reshape(-1, 3)
    if not border_loops(triangles, points):
        raise SurfaceError(f"{name}: the mesh is closed; a film needs a border")
    held = held_border(points, triangles, mirrors)
    n = len(points)
    start = StartMesh(held.snapped(points), triangles, np.full(n, -1), np.full(n, np.nan))
    try:
        return _finished(start, held, name, stable, ())
    except PinchError as error:
        raise SurfaceError(
            f"{error}; the border admits no film of this shape: move its parts closer together"
        ) from error


def border_rims(
    points: FloatArray, triangles: IntArray, *, corner_angle: float = 30.0, name: str = "border"
) -> tuple[Rim, ...]:
    """Return the border curves of a mesh as rims through its border vertices.

    Parameters
    ----------
    points : (n, 3) float, in mm
    triangles : (m, 3) int
    corner_angle : float
        Degrees: where the border turns by more, the rim has a sharp corner.
    name : str

    Raises
    ------
    MeshError
        If the mesh is not a manifold.
    DesignError
        If no good curve passes through the vertices; the place is named.
    """
    rims = []
    for k, loop in enumerate(border_loops(triangles, points)):
        ahead = points[np.roll(loop, -1)] - points[loop]
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        turn = np.degrees(np.arccos(np.clip((ahead * np.roll(ahead, 1, axis=0)).sum(1), -1, 1)))
        corners = np.flatnonzero(turn > corner_angle).tolist()
        rims.append(Rim.through(points[loop], corners=corners, name=f"{name} {k + 1}"))
    return tuple(rims)


def rimmed(film: MeshFilm, *, corner_angle: float = 30.0) -> MeshFilm:
    """Return a film of a given mesh with its border curves as rims.

    Raises
    ------
    DesignError
        See `border_rims`.
    """
    rims = border_rims(film.points, film.triangles, corner_angle=corner_angle, name=film.name)
    rim_of, parameter = film.rim_of.copy(), film.parameter.copy()
    for k, (loop, rim) in enumerate(zip(film.border_loops(), rims, strict=True)):
        t, along = rim.samples(16 * len(loop))
        rim_of[loop] = k
        parameter[loop] = t[cKDTree(along).query(film.points[loop])[1]]
    return replace(film, rims=rims, border=rims, rim_of=rim_of, parameter=parameter, given=True)


def film_from(start: StartMesh, name: str, rims: tuple[Rim, ...]) -> MeshFilm:
    """Return the film of a start mesh whose border vertices are fixed.

    Where soap would leave the shape that is given, the minimal surface next to it is taken.

    Raises
    ------
    SurfaceError
        If it pinches.
    """
    held = held_border(start.points, start.triangles, ())
    try:
        return _finished(start, held, name, True, rims)
    except PinchError as error:
        try:
            return _finished(start, held, name, False, rims)
        except SurfaceError:
            pass
        raise SurfaceError(f"{error}; there is no film of this shape in the rims") from error


def moved_film(film: MeshFilm, points: FloatArray, rims: tuple[Rim, ...]) -> MeshFilm:
    """Return the film on the same mesh after its fixed vertices moved a little.

    Parameters
    ----------
    film : MeshFilm
    points : (n, 3) float, in mm
        Only those of fixed vertices count.
    rims : tuple of Rim
        On which they lie, at the same parameters as before.

    Raises
    ------
    SurfaceError
        If it does not settle from where it was.
    """
    move = np.where(film.held.fixed[:, None], points - film.points, 0.0)
    free = np.flatnonzero(~film.held.fixed)
    matrix = stiffness(film.points, film.triangles).tocsr()
    move[free] = factorise(matrix[free][:, free]).solve(-(matrix @ move)[free])
    smooth = collocate(film.points + move, film.triangles, film.held, film.name, film.atlas.charts)
    return replace(
        film,
        points=smooth.points,
        atlas=smooth.atlas,
        rims=rims,
        border=rims,
        area=smooth_area(
            smooth.points, film.triangles, smooth.atlas, rims, film.rim_of, film.parameter
        ),
        defect=smooth.defect,
        smallest_angle=smallest_angle(smooth.points, film.triangles),
        off_rim=_off_rim(smooth.atlas, rims, film.rim_of, film.held),
        steps=film.steps + smooth.steps,
        rough=smooth.rough,
    )


def _finished(
    start: StartMesh, held: Held, name: str, stable: bool, rims: tuple[Rim, ...]
) -> MeshFilm:
    least = descend(start.points, start.triangles, held, name=name, stable=stable)
    smooth = collocate(least.points, least.triangles, held, name)
    rim_of = np.where(held.fixed, start.rim_of, -1)
    parameter = np.where(held.fixed, start.parameter, np.nan)
    area = smooth_area(smooth.points, least.triangles, smooth.atlas, rims, rim_of, parameter)
    return MeshFilm(
        name=name,
        points=smooth.points,
        triangles=least.triangles,
        atlas=smooth.atlas,
        rims=rims,
        border=rims,
        rim_of=rim_of,
        parameter=parameter,
        held=held,
        area=area,
        gradient=least.gradient,
        defect=smooth.defect,
        moved=smooth.moved,
        smallest_angle=smallest_angle(smooth.points, least.triangles),
        off_rim=_off_rim(smooth.atlas, rims, rim_of, held),
        steps=least.steps + smooth.steps,
        unstable=least.unstable,
        rough=smooth.rough,
    )


def _off_rim(atlas: Atlas, rims: tuple[Rim, ...], rim_of: IntArray, held: Held) -> float:
    """Return the largest distance of the rims from the film; 0 where sides of them are free."""
    if held.mirrors:
        return 0.0
    counts = [3 * int((rim_of == k).sum()) for k in range(len(rims))]
    heights = [
        heights_over(atlas, rim.samples(n)[1])[0] for rim, n in zip(rims, counts, strict=True)
    ]
    return max((float(np.abs(height).max()) for height in heights), default=0.0)


def _remedy(rims: tuple[Rim, ...], mirrors: tuple[Mirror, ...]) -> str:
    """Return what to do about a film that pinches."""
    if len(rims) < 2 or mirrors:
        return "there is no film of this shape in the rims; change them"
    try:
        limit = film_limit(rims)
    except SurfaceError as error:
        return str(error)
    if len(rims) == 2:
        return (
            f"the rims are too far apart: with their centres {limit.distance:.0f} mm apart "
            f"({100 * limit.share:.1f} % of the present distance) it still exists"
        )
    return (
        "the rims are too far apart: moved together to "
        f"{100 * limit.share:.1f} % of their present distances from their middle, "
        f"{limit.distance:.0f} mm in the mean, it still exists"
    )

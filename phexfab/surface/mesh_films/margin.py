"""A film that goes on beyond its rims: the same minimal surface on a mesh with a margin.

The film is bounded by rims a margin further out, whose heights are corrected until the film passes
through the rims that were given. Going on beyond a rim amplifies waves along it by e^(2π n m/L), n
their number, m the margin and L the rim's length (the Cauchy problem is ill posed), so that the
correction of each wave is amplified alike, up to a limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.errors import DesignError, SurfaceError
from phexfab.surface.mesh_films.atlas import Atlas
from phexfab.surface.mesh_films.film_area import heights_over
from phexfab.surface.mesh_films.mesh_film import MeshFilm, film_from, mesh_film, moved_film
from phexfab.surface.mesh_films.start import StartMesh
from phexfab.surface.mesh_films.strip import strip
from phexfab.surface.rims.rim import Rim

FloatArray = NDArray[np.float64]

GAIN = 40.0
"""Greatest amplification of a wave of the correction."""

MITRE = 2.0
"""Longest way to an offset corner, in margins."""


@dataclass(frozen=True, eq=False)
class _Offset:
    """Samples of the curve a margin beyond a rim, where it is kept.

    Attributes
    ----------
    rim : Rim
        The given rim.
    inner, outer : (k, 3) float
        Samples of the rim and of the curve beyond, mm.
    normals : (k, 3) float
        Of the film at the outer samples; along them heights are corrected.
    length : (k,) float
        Arc length along the rim, mm.
    corners : tuple of int
        Which samples are sharp corners.
    """

    rim: Rim
    inner: FloatArray
    outer: FloatArray
    normals: FloatArray
    length: FloatArray
    corners: tuple[int, ...]


def mesh_film_with_margin(
    film: MeshFilm, margin: float | Sequence[float], *, corrections: int = 3
) -> MeshFilm:
    """Return the film continued by a margin beyond each of its rims.

    Parameters
    ----------
    film : MeshFilm
        From `mesh_film`, or from `film_of_mesh` through `rimmed`, without mirrors.
    margin : float, or one for each rim
        Width of the margin, mm, along the film at right angles to the rim.
    corrections : int
        How often the outer rims are corrected, at most.

    Returns
    -------
    MeshFilm
        Its `border` lies the margin beyond, `rims` are the given ones and `off_rim` says how far
        they are from the film, mm.

    Raises
    ------
    SurfaceError
        If the film has no rims or has mirrors, the margin is wider than a hollow of a rim is
        round, or the wider film pinches.
    """
    if not film.rims or film.held.mirrors:
        raise SurfaceError(
            f"{film.name}: a margin needs a film between given rims, without mirrors"
        )
    shortest = min(rim.length for rim in film.rims)
    margins = np.broadcast_to(np.asarray(margin, float), len(film.rims)).tolist()
    for rim, width in zip(film.rims, margins, strict=True):
        if not 0 < width < rim.length / 8:
            raise SurfaceError(
                f"margin = {width:g} mm: take one between 0 and {rim.length / 8:.0f} mm, an eighth "
                f"of {rim.name}"
            )
    edge = _edge(film)
    offsets = [_offset(film, k, width, edge) for k, width in enumerate(margins)]
    best = _widened(film, offsets, edge)
    share = 1.0
    for _ in range(corrections):
        if best.off_rim < 1e-9 * shortest:
            break
        gaps = [heights_over(best.atlas, offset.inner) for offset in offsets]
        tried = [
            _corrected(offset, share * height, normal, width)
            for offset, (height, normal), width in zip(offsets, gaps, margins, strict=True)
        ]
        wide = _lifted(best, film, tried) or _widened(film, tried, edge)
        if wide.off_rim < best.off_rim:
            best, offsets = wide, tried
        else:  # waves that the margin cannot take, as those of a corner, weigh too much
            share *= 0.5
    return best


def _widened(film: MeshFilm, offsets: list[_Offset], edge: float) -> MeshFilm:
    border = tuple(_as_rim(offset) for offset in offsets)
    if film.given:
        wide = film_from(_with_strips(film, border, edge), film.name, border)
    else:
        wide = mesh_film(border, edge, name=film.name)
    return _measured(wide, film, offsets)


def _lifted(wide: MeshFilm, film: MeshFilm, offsets: list[_Offset]) -> MeshFilm | None:
    """Return the film of nearly the same rims on the same mesh; None where it does not settle."""
    border = tuple(_as_rim(offset) for offset in offsets)
    points = wide.points.copy()
    for k, rim in enumerate(border):
        on = np.flatnonzero(wide.rim_of == k)
        points[on] = rim.point(wide.parameter[on])
    try:
        lifted = moved_film(wide, points, border)
    except SurfaceError:
        return None
    return _measured(lifted, film, offsets)


def _measured(wide: MeshFilm, film: MeshFilm, offsets: list[_Offset]) -> MeshFilm:
    off = max(float(np.abs(heights_over(wide.atlas, offset.inner)[0]).max()) for offset in offsets)
    return replace(wide, rims=film.rims, off_rim=off)


def _with_strips(film: MeshFilm, border: tuple[Rim, ...], edge: float) -> StartMesh:
    """Return the film's own mesh with a strip from each of its borders to a rim further out."""
    points, triangles = [film.points], [film.triangles]
    rim_of = [np.full(len(film.points), -1)]
    parameter = [np.full(len(film.points), np.nan)]
    count = len(film.points)
    for loop in film.border_loops():
        k = int(film.rim_of[loop[0]])
        t, outer = border[k].samples(max(12, round(border[k].length / edge)))
        spots, made = strip([(film.parameter[loop], film.points[loop]), (t, outer)], edge)
        # The film runs along its border; the strip must run against it.
        low = made[(made < len(loop)).sum(axis=1) == 2][0]
        i = int(np.flatnonzero((low < len(loop)) & (np.roll(low, -1) < len(loop)))[0])
        if (low[(i + 1) % 3] - low[i]) % len(loop) == 1:
            made = made[:, ::-1]
        number = np.concatenate([loop, count + np.arange(len(spots) - len(loop))])
        triangles.append(number[made])
        points.append(spots[len(loop) :])
        here = np.full(len(spots) - len(loop), -1)
        at = np.full(len(here), np.nan)
        here[: len(outer)], at[: len(outer)] = k, t
        rim_of.append(here)
        parameter.append(at)
        count += len(here)
    return StartMesh(
        np.concatenate(points),
        np.concatenate(triangles),
        np.concatenate(rim_of),
        np.concatenate(parameter),
    )


def _edge(film: MeshFilm) -> float:
    counts = [int((film.rim_of == k).sum()) for k in range(len(film.rims))]
    return max(rim.length / n for rim, n in zip(film.rims, counts, strict=True))


def _offset(film: MeshFilm, k: int, margin: float, edge: float) -> _Offset:
    rim = film.rims[k]
    count = max(48, 4 * len(rim.corners), int(np.ceil(rim.length / min(edge, margin))))
    t, points = rim.samples(count)
    sign = inward(film, k)
    after, before = rim.derivative(t), rim.derivative(t, before=True)
    _, vertex = cKDTree(film.points).query(points)
    z = film.atlas.parameter_near(points, vertex)
    normals = film.surface.normal(z)
    steps = []
    for tangent in (before, after):
        outward = np.cross(tangent, normals) * sign
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        steps.append(outward)
    # Both sides' offset lines meet on the bisector.
    cosine = (steps[0] * steps[1]).sum(1)
    outward = (steps[0] + steps[1]) / (1 + np.maximum(cosine, -0.5))[:, None]
    reach = np.linalg.norm(outward, axis=1)
    outward *= np.minimum(1.0, MITRE / np.maximum(reach, 1e-12))[:, None]
    bend = _normal_curvature(film.atlas, z, outward)
    # At a re-entrant corner the film bends without bound: there the term says nothing.
    bend = np.clip(bend, -0.5 / margin, 0.5 / margin)
    outer = points + margin * outward + (0.5 * margin**2 * bend)[:, None] * normals
    sharp = np.isin(t, rim.corners)
    keep = _clear(rim, outer, margin, sharp)
    if keep.sum() < 12:
        raise SurfaceError(
            f"{rim.name}: a margin of {margin:g} mm is wider than the hollow it would fill"
        )
    corner = tuple(np.flatnonzero(sharp[keep]).tolist())
    return _Offset(rim, points[keep], outer[keep], normals[keep], rim.arc_length(t)[keep], corner)


def inward(film: MeshFilm, k: int) -> float:
    """Return +1 where the film lies left of the rim seen from the normals' tip, else -1."""
    for loop in film.border_loops():
        if film.rim_of[loop[0]] == k:
            t = film.parameter[loop]
            ahead = (np.roll(t, -1) - t + 0.5) % 1.0 - 0.5
            return 1.0 if np.median(ahead) > 0 else -1.0
    raise SurfaceError(f"{film.name}: rim {k} is no border of the mesh")


def _normal_curvature(atlas: Atlas, z: NDArray[np.complex128], direction: FloatArray) -> FloatArray:
    """Return II of tangential directions (n, 3): how fast the film rises along its normal."""
    surface = atlas.surface
    phi = surface.tangent(z)
    square = 0.5 * (phi.real**2 + phi.imag**2).sum(1)
    step = ((phi * direction).sum(1).conj()) / square  # dz of the direction
    return -np.real(surface.hopf(z) * step**2) * surface.scale


def _clear(
    rim: Rim, outer: FloatArray, margin: float, sharp: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which outer samples keep their distance from the rim, and are no loop of their own."""
    _, dense = rim.samples(max(256, 8 * len(outer)))
    away, _ = cKDTree(dense).query(outer)
    return (away > 0.97 * margin) | (sharp & (away > 0.9 * margin))


def _as_rim(offset: _Offset) -> Rim:
    try:
        return Rim.through(offset.outer, offset.corners, name=f"{offset.rim.name} with margin")
    except DesignError as error:
        raise SurfaceError(
            f"{error}; the margin is too wide for a hollow or a re-entrant corner of "
            f"{offset.rim.name}: narrow the margin, or round the corner"
        ) from error


def _corrected(offset: _Offset, height: FloatArray, normal: FloatArray, margin: float) -> _Offset:
    """Return the outer samples moved so that the film comes up to the rim by ``height``."""
    length = offset.rim.length
    n = 2 * len(height)
    # Heights at even steps of arc length, amplified wave by wave.
    even = np.arange(n) / n * length
    values = np.interp(even, offset.length, height, period=length)
    wave = np.fft.rfft(values)
    gain = np.exp(np.minimum(2 * np.pi * np.arange(len(wave)) * margin / length, np.log(GAIN)))
    # Beyond the limit noise would grow: those waves are left to what they are.
    gain[gain >= GAIN] = 1.0
    lifted = np.fft.irfft(wave * gain, n)
    rise = np.interp(offset.length, even, lifted, period=length)
    side = np.sign((normal * offset.normals).sum(1))
    return replace(offset, outer=offset.outer + (side * rise)[:, None] * offset.normals)

"""A smooth curve a margin outside a film's boundary, near the film's continuation."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial import cKDTree

from phexfab.errors import SurfaceError
from phexfab.surface.disc_films.plateau import DiscFilm

FloatArray = NDArray[np.float64]

TURN = 1.2  # margins of rim over which the conormal is averaged
ROUND = 0.35  # margins of rim over which the offset curve is averaged
MITRE = 2.0  # longest way to an offset corner, in margins
CORNER = 0.8  # share by which the margin is wider at corners
UNFOLDED = 0.4  # least length of the offset curve by that of the rim
SLIMMEST = 0.4  # share of the margin below which a place is refused


@dataclass(frozen=True, eq=False)
class FilmEdge:
    """The film's boundary at uniform arc length: points, conormals, normals, normal curvature.

    ``corners`` are the places (c, 3) of its sharp corners.
    """

    points: FloatArray
    outward: FloatArray
    normal: FloatArray
    bend: FloatArray
    step: float
    corners: FloatArray


def film_edge(film: DiscFilm, margin: float) -> FilmEdge:
    """Return the boundary, sampled finely against the margin; corners fall between samples."""
    z = np.exp(1j * film.angles)
    sharp = np.isin(film.boundary, film.rim.corners) if len(film.rim.corners) else z == 0
    sharp |= np.isnan(film.boundary) & _kinked(film.points)
    surface = film.surface
    phi = np.where(sharp[:, None], 1.0, surface.tangent(np.where(sharp, 0.0, z)))
    outward = (phi * z[:, None]).real
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    with np.errstate(all="ignore"):
        bend = -(surface.hopf(np.where(sharp, 0.0, z)) * z**2).real
        bend *= surface.scale / surface.conformal_factor(np.where(sharp, 0.0, z)) ** 2
    bend = np.clip(bend, -0.5 / margin, 0.5 / margin)
    closed = np.vstack([film.points, film.points[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    total = length[-1]
    count = int(np.clip(2 ** np.ceil(np.log2(12 * total / margin)), 512, 8192))
    wanted = (np.arange(count) + 0.5) * total / count
    smooth = ~sharp
    at, table = length[:-1][smooth], np.column_stack([outward, bend])[smooth]
    ends = np.concatenate([[-1.0], length[:-1][sharp], [total + 1.0]])
    found = np.empty((count, 4))
    if not sharp.any():
        at = np.concatenate([at[-4:] - total, at, at[:4] + total])
        table = np.concatenate([table[-4:], table, table[:4]])
    for low, high in pairwise(ends):
        here, new = (at >= low) & (at < high), (wanted >= low) & (wanted < high)
        if new.any() and here.sum() > 1:
            inside = np.clip(wanted[new], at[here][0], at[here][-1])
            found[new] = PchipInterpolator(at[here], table[here])(inside)
    points = (
        CubicSpline(length, closed)(wanted)
        if not sharp.any()
        else _along(length, closed, np.append(sharp, sharp[0]), wanted)
    )
    outward = found[:, :3] / np.linalg.norm(found[:, :3], axis=1, keepdims=True)
    tangent = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    # Around the disc counter-clockwise the conormal is on the right: N = ν × T.
    normal = np.cross(outward, tangent)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return FilmEdge(points, outward, normal, found[:, 3], total / count, film.points[sharp])


def _along(
    length: FloatArray, closed: FloatArray, sharp: NDArray[np.bool_], wanted: FloatArray
) -> FloatArray:
    """Return points at arc lengths, by cubics between corners."""
    found = np.empty((len(wanted), 3))
    ends = np.unique(np.concatenate([[0], np.flatnonzero(sharp), [len(length) - 1]]))
    for low, high in pairwise(ends):
        new = (wanted >= length[low]) & (wanted <= length[high])
        part = slice(low, high + 1)
        keep = np.append(True, np.diff(length[part]) > 1e-12 * length[-1])
        at, values = length[part][keep], closed[part][keep]
        # Samples crowd at corners, down to rounding: a side of them alone is a point.
        found[new] = PchipInterpolator(at, values)(wanted[new]) if len(at) > 1 else values[0]
    return found


def _kinked(points: FloatArray) -> NDArray[np.bool_]:
    """Return where a polygon turns by more than 20 degrees."""
    ahead = np.roll(points, -1, axis=0) - points
    size = np.linalg.norm(ahead, axis=1, keepdims=True)
    ahead = ahead / np.maximum(size, 1e-300)
    return (ahead * np.roll(ahead, 1, axis=0)).sum(1) < np.cos(np.radians(20.0))


def averaged(values: FloatArray, width: float) -> FloatArray:
    """Return periodic samples (n, k) averaged by a Gaussian of so many samples."""
    waves = np.fft.rfftfreq(len(values))
    damp = np.exp(-0.5 * (2 * np.pi * waves * width) ** 2)
    return np.fft.irfft(damp[:, None] * np.fft.rfft(values, axis=0), len(values), axis=0)


def offset_curve(film: DiscFilm, edge: FilmEdge, margin: float, share: FloatArray) -> FloatArray:
    """Return a smooth closed curve (n, 3) about a margin outside the boundary, near the film.

    ``share`` (n,) is how much of the margin is wanted at each sample of the edge.
    """
    # A film is flat at a corner: panels are largest there.
    wanted = margin * share
    if len(edge.corners):
        away = cKDTree(edge.corners).query(edge.points)[0]
        wanted *= 1.0 + CORNER * np.exp(-((away / margin) ** 2))
    wide = 1.1 * wanted
    tree = cKDTree(edge.points)
    tangent = np.roll(edge.points, -1, axis=0) - np.roll(edge.points, 1, axis=0)
    turned = averaged(edge.outward, TURN * margin / edge.step)
    length = np.linalg.norm(turned, axis=1)
    along = (turned * edge.outward).sum(1)
    way = turned / length[:, None] * np.minimum(length / np.maximum(along, 1e-9), MITRE)[:, None]
    bend = averaged(edge.bend[:, None], 0.5 * margin / edge.step)
    for _ in range(30):
        d = wide[:, None]
        curve = edge.points + d * way + 0.5 * d**2 * bend * edge.normal
        curve = averaged(curve, ROUND * margin / edge.step)
        ahead = np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0)
        folded = (ahead * tangent).sum(1) < UNFOLDED * (tangent**2).sum(1)
        short = (tree.query(curve)[0] < wanted) & (wide < 1.4 * wanted)
        if folded.any():
            wide = wide * np.where(folded, 0.8, 1.0)
        elif short.any():
            wide = wide * np.where(short, 1.08, 1.0)
        else:
            break
        wide = averaged(wide[:, None], 0.5 * margin / edge.step)[:, 0]
    slim = wide / wanted
    if folded.any() or slim.min() < SLIMMEST:
        i = int(np.flatnonzero(folded)[0]) if folded.any() else int(slim.argmin())
        raise SurfaceError(
            f"{film.rim.name}: the film cannot go on beyond its rim by {margin:.0f} mm near "
            f"{edge.points[i].round(0).tolist()}, where the rim turns inwards too sharply; "
            "choose smaller panels or round the rim off there (surface.smooth_inward)"
        )
    return curve


def evened(curve: FloatArray, width: float) -> FloatArray:
    """Return a closed curve at equal distances, averaged over ``width`` (mm)."""
    for _ in range(3):
        closed = np.vstack([curve, curve[:1]])
        length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1)))
        even = np.arange(len(curve)) * length[-1] / len(curve)
        curve = np.column_stack([np.interp(even, length, column) for column in closed.T])
        curve = averaged(curve, width * len(curve) / length[-1])
    return curve

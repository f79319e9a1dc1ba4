"""A film that lies well over a plane, continued beyond its rim by its Gauss map.

In the coordinate u = (Φ₁ − iΦ₂)/2, with the third axis along the film's mean normal, the film is
∫ (1 − g², i(1 + g²), 2g) du: any holomorphic g gives a minimal surface, without branch points, and
u is the plan nearly to scale, corners included. So to go on beyond the rim takes no second film but
a smooth g over a larger domain that is the given one inside, fitted to the boundary values of g
with as little curvature as possible on the new border (`graph_fit`). At corners, where a film has
in general no continuation, the fit is off by the reported distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from phexfab.surface.disc_films.graph_fit import RAYS, BoundaryValues, pole_fit, polynomial_fit
from phexfab.surface.disc_films.graph_patches import GraphCurve, graph_curve
from phexfab.surface.disc_films.null_series import NullBoundary, null_curve_surface
from phexfab.surface.disc_films.plateau import DiscFilm
from phexfab.surface.domain import Star
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.weierstrass import MinimalSurface

FloatArray = NDArray[np.float64]

STEEPEST = 0.9  # of |g|: the film's normals stay within 84 degrees of the mean
DEGREE = 48
FITS = (0.1, 0.03, 0.01)  # weights of the curvature of g
POLE_FITS = (0.01, 0.003, 0.001)  # where no polynomial fits
SOLVED = 4e-3  # distance from the rim, in margins, at which no further fit is tried
DENSE = 8.0  # points of the rim per margin
STAR = 1e-3  # of the rim's turning about the centre: more is no turning back
SPECK = 1e-5  # share of the rim of samples that do not tell how steep a film is: beside corners
LEAST = 1e-12  # share of the rim of samples that are left out: corners, to rounding


@dataclass(frozen=True, eq=False)
class Plan:
    """The film's boundary in the plane of u: places, steps between them, values of g and of Φ.

    ``frame`` has the axes in space as rows; ``angles`` are those on the film's disc.
    """

    places: ComplexArray
    steps: ComplexArray
    gauss: ComplexArray
    angles: FloatArray
    points: FloatArray
    frame: FloatArray
    centre: complex


@dataclass(frozen=True, eq=False)
class Continued:
    """A continued film: its surface over a domain, the places of the film's boundary on it.

    ``apart`` is the largest distance of that boundary from the surface, mm.
    """

    surface: MinimalSurface
    domain: Star
    places: ComplexArray
    apart: float


def continued_over_plan(film: DiscFilm, margin: float, shares: FloatArray) -> Continued | None:
    """Return the film continued by its Gauss map, or None where it does not lie over a plane.

    Parameters
    ----------
    film : DiscFilm
    margin : float
        In mm.
    shares : (N,)
        Share of the margin that is wanted beside each of the film's boundary samples.
    """
    plan = _plan(film)
    if plan is None:
        return None
    size = film.surface.scale
    wanted = margin / size * np.interp(plan.angles, film.angles, shares, period=2 * np.pi)
    domain = _around(plan, wanted / (1 + np.abs(plan.gauss) ** 2))
    given = BoundaryValues(plan.places, plan.steps, plan.gauss, plan.centre)
    width = margin / size
    polynomials = (polynomial_fit(given, domain, DEGREE, stiff * width**2) for stiff in FITS)
    poles = (pole_fit(given, domain, width, stiff * width**2) for stiff in POLE_FITS)
    best: Continued | None = None
    for gauss_map in chain(polynomials, poles):
        if np.abs(gauss_map(domain.borders(RAYS)[0])).max() > 1.0:
            continue
        curve = graph_curve(gauss_map, domain, plan.frame)
        if curve is None:
            continue
        made = _placed(film, plan, domain, curve)
        if best is None or made.apart < best.apart:
            best = made
        if best.apart <= SOLVED * margin:
            break
    return best


def _plan(film: DiscFilm) -> Plan | None:
    """Return the boundary over the plane across the mean normal, None where u does not suit."""
    curve = film.curve
    if isinstance(curve, NullBoundary):
        nodes, steps, values, slopes = curve.nodes, curve.steps, curve.values, curve.slopes
    else:
        count = max(RAYS, len(film.angles))
        nodes = np.exp(2j * np.pi * np.arange(count) / count)
        steps = 2j * np.pi / count * nodes
        values, slopes = curve.derivatives(nodes, (0, 1))
    size = np.linalg.norm(slopes, axis=1) * np.abs(steps)
    kept = size > LEAST * size.sum()
    nodes, steps, values, slopes, size = (a[kept] for a in (nodes, steps, values, slopes, size))
    across = np.cross(slopes.imag, slopes.real)  # X_u × X_v
    up = (across / np.linalg.norm(across, axis=1)[:, None] * size[:, None]).sum(0)
    frame = _frame_below(up)
    phi, whole = slopes @ frame.T, values @ frame.T
    form = phi[:, 0] - 1j * phi[:, 1]
    with np.errstate(all="ignore"):
        gauss = phi[:, 2] / form
    if not np.abs(gauss[size > SPECK * size.sum()]).max() <= STEEPEST:
        return None
    places, steps = 0.5 * (whole[:, 0] - 1j * whole[:, 1]), 0.5 * form * steps
    after = np.roll(places, -1)
    area = (places.conj() * after).imag
    centre = complex(((places + after) * area).sum() / (3 * area.sum()))
    turn = np.angle((after - centre) / (places - centre))
    if abs(turn.sum() - 2 * np.pi) > 1e-6 or turn.min() < -STAR:
        return None
    return Plan(places, steps, gauss, np.angle(nodes) % (2 * np.pi), values.real, frame, centre)


def _frame_below(normal: FloatArray) -> FloatArray:
    """Return right-handed axes as rows, the third against the normal, where g = 0."""
    third = -normal / np.linalg.norm(normal)
    helper = np.eye(3)[int(np.argmin(np.abs(third)))]
    first = np.cross(helper, third)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(third, first), third])


def _around(plan: Plan, wanted: FloatArray) -> Star:
    """Return what lies within ``wanted`` (N,) of the boundary, or inside."""
    ring = np.append(plan.places, plan.places[0])
    length = np.append(0.0, np.cumsum(np.abs(np.diff(ring))))
    count = max(RAYS, int(DENSE * length[-1] / wanted.min()))
    even = np.arange(count) * length[-1] / count
    at = np.interp(even, length, ring) - plan.centre
    radius = np.interp(even, length, np.append(wanted, wanted[0]))
    reach = np.zeros(RAYS)
    # A disc about a boundary point is met by the rays within asin(radius / distance) of it.
    for k, ray in enumerate(np.exp(2j * np.pi * np.arange(RAYS) / RAYS)):
        turned = at * ray.conjugate()
        under = radius**2 - turned.imag**2
        hit = under >= 0
        reach[k] = (turned.real[hit] + np.sqrt(under[hit])).max(initial=0.0)
    return Star(plan.centre, reach=reach)


def _placed(film: DiscFilm, plan: Plan, domain: Star, curve: GraphCurve) -> Continued:
    """Return the surface of a null curve where it fits the film's boundary best."""
    size = film.surface.scale
    low, high = film.rim.box
    middle = 0.5 * (low + high)
    gap = plan.points - curve.derivatives(plan.places, (0,))[0].real
    shift = 0.5 * (gap.max(0) + gap.min(0))
    apart = float(np.linalg.norm(gap - shift, axis=1).max()) * size
    surface = null_curve_surface(curve, film.rim.name, size, middle + size * shift)
    return Continued(surface, domain, plan.places, apart)

"""Plateau's problem for the disc: the soap film of one closed rim as a holomorphic null curve.

Douglas: among all ways t(θ) of running along the rim while θ runs around the unit circle, the one
whose harmonic extension has the least Dirichlet energy is the film, conformally parametrised, and
its energy is its area. `plateau_grid` has the energy, `plateau_descent` the descent to its minimum.

References
----------
J. Douglas, "Solution of the problem of Plateau", Trans. AMS 33 (1931); Dierkes, Hildebrandt,
Sauvigny, *Minimal Surfaces* (2010), ch. 4; G. Dziuk, J. Hutchinson, "The discrete Plateau problem",
Math. Comp. 68 (1999).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.disc_films.descent import derivative_by_sample, settle
from phexfab.surface.disc_films.grid import DirichletForm
from phexfab.surface.disc_films.null_series import (
    NullBoundary,
    NullCurve,
    NullSeries,
    null_curve_surface,
)
from phexfab.surface.disc_films.sides import Sides, sides_of
from phexfab.surface.disc_films.state import BoundaryState, first_state, resampled
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.rims.rim import Rim
from phexfab.surface.weierstrass import MinimalSurface

FloatArray = NDArray[np.float64]

TOLERANCE = 1e-9
FEWEST, MOST = 128, 1024
GOOD = 1e-7  # conformality below which samples that no longer help end the search
ROUGH = 1e-2  # conformality above which a film is not resolved
LONGEST, CROWDED = 2048, 50.0  # samples of a series, and spread of their distances


@dataclass(frozen=True, eq=False)
class DiscFilm:
    """A soap film of the type of a disc.

    Attributes
    ----------
    rim : Rim
    surface : MinimalSurface
        Over the unit disc; its scale is the size of the rim in mm. Normals point down where the
        rim, seen from above, runs around an area.
    curve : NullCurve
        Φ in units of the scale, without its place in space.
    angles : (N,)
        Angles of the samples on the unit circle, ascending from the first corner or start.
    boundary : (N,)
        t(θ): the rim's parameter at each of them, monotone; nan on free sides.
    points : (N, 3)
        The film's boundary there, mm.
    conformality : float
        Largest |φ·φ| on the boundary by the largest |φ|², both per sample: 0 for an exact film.
    area : float
        mm².
    free : tuple of int
        The sides that slide in their planes.
    state : BoundaryState or None
        The samples from which it was made, for the films of similar rims to start from.
    """

    rim: Rim
    surface: MinimalSurface
    curve: NullCurve
    angles: FloatArray
    boundary: FloatArray
    points: FloatArray
    conformality: float
    area: float
    free: tuple[int, ...] = ()
    state: BoundaryState | None = None


def plateau(
    rim: Rim,
    *,
    samples: int | None = None,
    tolerance: float = TOLERANCE,
    free: Sequence[int] = (),
    start: DiscFilm | None = None,
) -> DiscFilm:
    """Return the soap film of the type of a disc that a rim bounds.

    A minimum of area, which need not be the only one. On smooth rims the error falls faster than
    any power of the number of samples; at corners samples are graded so that the boundary values
    are of order 6 there, and the energy of a higher one.

    Parameters
    ----------
    rim : Rim
    samples : int, optional
        Samples of the boundary; without it 128, 256, ... up to 1024 until the tolerance is reached
        or more samples no longer help.
    tolerance : float
        For `DiscFilm.conformality`.
    free : sequence of int
        Numbers of the sides (between corners, from the first) that slide in the plane in which
        they are drawn, so that the film meets it at right angles. A straight line in the film is
        an ordinary, fixed side.
    start : DiscFilm, optional
        The film of a rim nearly the same, parameter by parameter, both smooth: much faster. It is
        left aside where it turns out to be no good start.

    Raises
    ------
    SurfaceError
        If a free side cannot be free, or the film does not settle or is not resolved.

    Examples
    --------
    >>> import numpy as np
    >>> import phexfab as px
    >>> t = 2 * np.pi * np.arange(32) / 32
    >>> saddle = np.stack([3000 * np.cos(t), 3000 * np.sin(t), 500 * np.cos(2 * t)], axis=-1)
    >>> film = px.plateau(px.Rim.through(saddle))
    >>> print(f"{film.area / 1e6:.3f} m²")
    29.046 m²
    >>> bend = film.surface.principal_curvatures(0.0)
    >>> print((1e3 * bend).round(3))  # 1/m, in the middle
    [-0.109  0.109]
    """
    sides = sides_of(rim, free)
    if start is not None:
        near = _restarted(sides, start)
        if near is not None:
            return near
    least = max(FEWEST, 16 * sides.corners)
    counts = _counts(least, samples)
    best: tuple[float, BoundaryState, DirichletForm] | None = None
    now: BoundaryState | None = None
    trouble: SurfaceError | None = None
    for count in counts:
        try:
            if now is None:
                state, form = settle(first_state(sides, count))
            else:
                state, form = settle(resampled(now, 2), damping=0.0)
        except SurfaceError as error:
            trouble, now = error, None
            continue
        found = conformality(boundary_slopes(state, form))
        now = state if found < ROUGH else None
        before = np.inf if best is None else best[0]
        if found < before:
            best = (found, state, form)
        if found <= tolerance or (0.3 * before < found and before < GOOD):
            break
    if best is None:
        raise trouble or SurfaceError(f"{rim.name}: no samples")
    if best[0] > ROUGH:
        raise SurfaceError(
            f"{rim.name}: the soap film is not resolved by {len(best[1].s)} samples (conformality "
            f"{best[0]:.1e}): the rim is too long and narrow, or too sharply bent, for one disc"
        )
    return _film(sides, *best, tuple(sorted(sides.planes)))


def _restarted(sides: Sides, start: DiscFilm) -> DiscFilm | None:
    """Return the film next to that of a similar rim, or None where it is not as good."""
    if start.state is None or sides.corners or start.state.sides.corners:
        return None
    begun = replace(
        start.state,
        sides=sides,
        points=sides.point(sides.parameter(start.state.grid.side, start.state.s)),
    )
    try:
        state, form = settle(begun, damping=0.0)
    except SurfaceError:
        return None
    found = conformality(boundary_slopes(state, form))
    if found > max(2 * start.conformality, GOOD):
        return None
    return _film(sides, found, state, form, ())


def _counts(least: int, samples: int | None) -> list[int]:
    if samples is None:
        most = max(MOST, 2 * least)
        return [least * 2**k for k in range(12) if least * 2**k <= most]
    if samples < 8:
        raise SurfaceError(f"{samples} samples are too few for a film: at least 8")
    halvings = 0
    while samples % 2 ** (halvings + 1) == 0 and samples // 2 ** (halvings + 1) >= least:
        halvings += 1
    return [samples // 2**k for k in range(halvings, -1, -1)]


def boundary_slopes(state: BoundaryState, form: DirichletForm) -> ComplexArray:
    """Return the change of Φ per sample, (N, 3): X_θ + i X_r, times dθ."""
    return derivative_by_sample(state.points) + 1j * (form.matrix @ state.points)


def conformality(slopes: ComplexArray) -> float:
    """Return the largest |φ·φ| by the largest |φ|², per sample, at and midway between samples."""
    both = np.stack([slopes, shifted(slopes, 0.5)])
    return float(np.abs((both**2).sum(-1)).max() / (np.abs(both) ** 2).sum(-1).max())


def shifted(values: ComplexArray, by: float) -> ComplexArray:
    """Return periodic samples (N, ...) moved by a share of their distance, spectrally."""
    count = len(values)
    waves = np.fft.fftfreq(count)
    turn = np.exp(2j * np.pi * by * waves)
    turn[count // 2] = np.cos(np.pi * by)
    return np.fft.ifft(turn[:, None] * np.fft.fft(values, axis=0), axis=0)


def _film(
    sides: Sides,
    defect: float,
    state: BoundaryState,
    form: DirichletForm,
    free: tuple[int, ...],
) -> DiscFilm:
    grid, count = state.grid, len(state.s)
    theta, slopes = grid.angles(state.gaps), boundary_slopes(state, form)
    waves = 2j * np.pi * np.fft.fftfreq(count)
    waves[[0, count // 2]] = np.inf
    other = np.fft.ifft(np.fft.fft(slopes.imag, axis=0) / waves[:, None], axis=0).real
    values = state.points + 1j * other
    t = np.where(state.free, np.nan, state.parameters())
    weights = grid.weights(state.gaps)
    points = state.points
    upward = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    if upward[2] > 0:
        # The other orientation, z -> conj z: normals then point down, away from the pole of g.
        back = -np.arange(count) % count
        theta = np.where(back == 0, 0.0, 2 * np.pi - theta)[back]
        values, slopes, weights = values.conj()[back], -slopes.conj()[back], weights[back]
        t, points = t[back], points[back]
    nodes = np.exp(1j * theta)
    curve: NullCurve | None = None
    if not sides.corners:
        curve = _series(values, state, backwards=bool(upward[2] > 0))
    if curve is None:
        with np.errstate(all="ignore"):
            steps = 1j * nodes * weights
            tangents = np.where(weights[:, None] > 0, slopes / steps[:, None], 0.0)
        inner = weights > 0
        curve = NullBoundary(nodes[inner], steps[inner], values[inner], tangents[inner])
    return DiscFilm(
        rim=sides.rim,
        surface=null_curve_surface(curve, sides.rim.name, sides.size, sides.middle),
        curve=curve,
        angles=theta,
        boundary=t,
        points=sides.middle + sides.size * points,
        conformality=defect,
        area=form.energy(state.points) * sides.size**2,
        free=free,
        state=state,
    )


def _series(values: ComplexArray, state: BoundaryState, backwards: bool) -> NullSeries | None:
    """Return the Taylor series, or None where it would have to be too long."""
    stretch = state.grid.stretches[0]
    if stretch is None:
        return NullSeries.from_samples(values)
    weights = state.grid.weights(state.gaps)
    if weights.max() > CROWDED * weights.min():
        return None
    count = len(values)
    waves = np.fft.fft(values, axis=0) / count
    number = np.fft.fftfreq(count, 1 / count)
    size = 2 * count
    while size <= LONGEST:
        place = np.arange(size) / size
        if backwards:
            place = -place % 1.0
        tau = stretch.inverse(place)
        if backwards:
            tau = -tau % 1.0
        found = NullSeries.from_samples(np.exp(2j * np.pi * tau[:, None] * number) @ waves)
        rough = np.abs(found.coefficients[int(0.4 * size) :]).max(initial=0.0)
        if rough <= 1e-11 * np.abs(found.coefficients[1:]).max():
            return found
        size *= 2
    return None


def umbilic_count(film: DiscFilm, radius: float = 1.0) -> int:
    """Return the number of umbilics inside ``|z| = radius``, with multiplicity.

    It is the winding number of the Hopf differential Q: 0 for a saddle, 1 for a rim of three
    lobes, n − 2 for n.

    Parameters
    ----------
    film : DiscFilm
    radius : float
        Below 1 for rims with corners, where Q has a singularity on the circle.

    Raises
    ------
    SurfaceError
        If an umbilic lies on the circle, or closer to it than can be told; or the film is plane.
    """
    count = 512
    while count <= 32768:
        q = film.surface.hopf(radius * np.exp(2j * np.pi * (np.arange(count) + 0.5) / count))
        with np.errstate(all="ignore"):
            turn = np.angle(np.roll(q, -1) / q)
        if np.isfinite(turn).all() and np.abs(turn).max() < 1.0:
            return int(np.rint(turn.sum() / (2 * np.pi)))
        count *= 4
    raise SurfaceError(
        f"{film.rim.name}: umbilics cannot be counted on |z| = {radius:g}: one lies on it, or the "
        "film is plane; take another radius"
    )

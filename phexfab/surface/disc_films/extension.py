"""A disc-type film that goes on beyond its rim.

Where the film's series still converges beyond the unit circle, it is simply used further out. Where
the film lies well over a plane, its Gauss map is continued (`graph_extension`). Else a second film
is sought, of a smooth rim a margin further out, which passes through the given rim: the given
boundary is moved along the film's conormal (rounded off at corners, bent with the film), and the
heights of the new rim are corrected until the given rim lies on the new film. To go on beyond a
boundary is an ill-posed problem (Cauchy's): waves along the rim grow outwards as
e^(margin/wavelength), so that fit and correction are regularised; a corner, at which a film has in
general no continuation, is met to the reported distance and not exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from phexfab.errors import SurfaceError
from phexfab.surface.disc_films.extension_offset import averaged, evened, film_edge, offset_curve
from phexfab.surface.disc_films.graph_extension import continued_over_plan
from phexfab.surface.disc_films.null_series import NullSeries, null_curve_surface
from phexfab.surface.disc_films.plateau import DiscFilm, plateau
from phexfab.surface.domain import Disc, Star
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.rims.rim import Rim
from phexfab.surface.weierstrass import MinimalSurface

FloatArray = NDArray[np.float64]

FILM = 1e-7  # conformality asked of films
CORRECTIONS = 3
RIM_SAMPLES = 400
FAITHFUL = 1e-6  # conformality up to which a series is used further out
CUT = 1e-7  # share of the size that may be cut off such a series
FARTHEST = 0.1  # distance from the rim, in margins, above which an extension is refused
SOLVED = 1e-3  # distance from the rim, in margins, at which corrections end
DAMPED = 0.1  # of the correction: its waves grow at most 1/(2·DAMPED) times outwards


@dataclass(frozen=True, eq=False)
class ExtendedFilm:
    """A film with a margin beyond its rim.

    Attributes
    ----------
    surface : MinimalSurface
    domain : Disc
        Of its parameters.
    film : DiscFilm
        The film of the given rim.
    margin : float
        Least distance from the end of the surface to the given rim, mm, over the share wanted.
    rim_distance : float
        Largest distance from the film's given boundary to the surface, mm.
    rim_parameters : (n,) complex
        The places of the film's boundary on the surface, once around.
    """

    surface: MinimalSurface
    domain: Disc
    film: DiscFilm
    margin: float
    rim_distance: float
    rim_parameters: ComplexArray

    @property
    def core(self) -> Disc:
        """The part of the domain inside the rim."""
        arm = self.rim_parameters - self.domain.centre
        turn = 2 * np.pi * np.arange(len(arm)) / len(arm)
        reach = np.interp(turn, np.angle(arm), np.abs(arm), period=2 * np.pi)
        return Star(self.domain.centre, reach=reach)

    def contains(self, z: ComplexArray) -> NDArray[np.bool_]:
        """Return whether parameters belong to the surface."""
        return self.domain.contains(z)


def film_with_margin(
    rim: Rim,
    margin: float,
    free: Sequence[int] = (),
    shares: Callable[[DiscFilm], FloatArray] | None = None,
) -> ExtendedFilm:
    """Return the film of a rim, going on beyond it by at least about ``margin`` (mm).

    Parameters
    ----------
    rim : Rim
    margin : float, mm
    free : sequence of int
        Numbers of the sides that slide in their plane, see `plateau`.
    shares : callable, optional
        The margins that the film asks for, see `extended`.

    Raises
    ------
    SurfaceError
        As `plateau` and `extended`.

    Examples
    --------
    >>> import numpy as np
    >>> import phexfab as px
    >>> t = 2 * np.pi * np.arange(32) / 32
    >>> saddle = np.stack([3000 * np.cos(t), 3000 * np.sin(t), 500 * np.cos(2 * t)], axis=-1)
    >>> wide = px.film_with_margin(px.Rim.through(saddle), 400.0)
    >>> wide.margin >= 400.0, wide.rim_distance < 0.1  # mm
    (True, True)
    """
    film = plateau(rim, tolerance=FILM, free=free)
    return extended(film, margin, None if shares is None else shares(film))


def extended(film: DiscFilm, margin: float, shares: FloatArray | None = None) -> ExtendedFilm:
    """Return a surface that contains a film and goes on beyond its boundary.

    Parameters
    ----------
    film : DiscFilm
    margin : float
        In mm. Small against the size of the film; about two panels.
    shares : (N,), optional
        Share of the margin that is wanted beside each of the film's boundary samples; 1 everywhere
        when left out.

    Raises
    ------
    SurfaceError
        If the margin is not positive or larger than a third of the rim, or the boundary turns
        inwards so sharply that the film cannot go on there by the margin.
    """
    if not 0 < margin <= film.surface.scale / 3:
        raise SurfaceError(
            f"{film.rim.name}: a margin of {margin:g} mm cannot be had around a rim of size "
            f"{film.surface.scale:.0f} mm; it must be positive and at most a third of that"
        )
    wanted = np.ones(len(film.angles)) if shares is None else np.asarray(shares, float)
    return (
        _continued(film, margin, wanted)
        or _over_plan(film, margin, wanted)
        or _enclosed(film, margin, wanted)
    )


def _continued(film: DiscFilm, margin: float, shares: FloatArray) -> ExtendedFilm | None:
    """Return the film on a larger circle, if its series is good for it."""
    if not isinstance(film.curve, NullSeries):
        return None
    angles = 2 * np.pi * np.arange(1024) / 1024
    circle = np.exp(1j * angles)
    rim = film.surface.point(circle)
    tree = cKDTree(rim)
    share = np.interp(angles, film.angles, shares, period=2 * np.pi)
    sizes = np.abs(film.curve.coefficients).max(axis=1)
    tail = np.cumsum(sizes[::-1])[::-1]
    count = int(np.searchsorted(-tail, -CUT))
    series = NullSeries(film.curve.coefficients[: max(count, 2)])

    def reached(radius: float) -> float:
        surface = _scaled_surface(series.stretched(radius), film)
        away, beside = tree.query(surface.point(circle))
        return float((away / share[beside]).min())

    low, high = 1.0, 1.02
    while reached(high) < margin:
        low, high = high, 1 + 1.6 * (high - 1)
        if high > 2:
            return None
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if reached(middle) >= margin else (middle, high)
    grown = series.stretched(high)
    (phi,) = grown.derivatives(circle, (1,))
    square = (np.abs(phi) ** 2).sum(1)
    inner = (np.abs(series.stretched(1.0).derivatives(circle, (1,))[0]) ** 2).sum(1) * high**2
    lost = (sizes * high ** np.arange(len(sizes)))[count:].sum()
    if (
        np.abs((phi**2).sum(1)).max() > FAITHFUL * square.max()
        or lost > 1e2 * CUT
        or (square < 0.1 * inner).any()
    ):
        return None
    surface = _scaled_surface(grown, film)
    at = np.exp(1j * film.angles) / high
    apart = np.linalg.norm(surface.point(at) - film.points, axis=1).max()
    return ExtendedFilm(surface, Disc(), film, reached(high), float(apart), at)


def _scaled_surface(series: NullSeries, film: DiscFilm) -> MinimalSurface:
    low, high = film.rim.box
    return null_curve_surface(series, film.rim.name, film.surface.scale, 0.5 * (low + high))


def _over_plan(film: DiscFilm, margin: float, shares: FloatArray) -> ExtendedFilm | None:
    """Return the film continued by its Gauss map, if that meets the rim."""
    made = continued_over_plan(film, margin, shares)
    if made is None or made.apart > FARTHEST * margin:
        return None
    border = made.surface.point(made.domain.borders(1024)[0])
    away, beside = cKDTree(film.points).query(border)
    reached = float((away / shares[beside]).min())
    return ExtendedFilm(made.surface, made.domain, film, reached, made.apart, made.places)


def _enclosed(film: DiscFilm, margin: float, shares: FloatArray) -> ExtendedFilm:
    edge = film_edge(film, margin)
    wanted = int(np.clip(edge.step * len(edge.points) / (0.1 * margin), 256, 1024))
    share = shares[cKDTree(film.points).query(edge.points)[1]]
    share = averaged(share[:, None], 0.5 * margin / edge.step)[:, 0]
    curve = evened(offset_curve(film, edge, margin, share), 0.2 * margin)
    curve = curve[:: max(1, len(curve) // wanted)]
    outer_rim = Rim.through(curve, name=film.rim.name)
    target = edge.points[:: max(1, len(edge.points) // RIM_SAMPLES)]
    best: tuple[float, DiscFilm, ComplexArray, FloatArray] | None = None
    for _ in range(CORRECTIONS + 1):
        try:
            # A corrected rim differs little from the one before.
            outer = plateau(outer_rim, tolerance=FILM, start=best and best[1])
            at, height, apart = _feet(outer.surface, target)
        except SurfaceError:
            break
        worst = float(apart.max())
        if best is None or worst < best[0]:
            gained = best is None or worst < 0.7 * best[0]
            best = (worst, outer, at, apart)
        else:
            gained = False
        if not gained or worst <= SOLVED * margin:
            break
        outer_rim = _corrected(outer, at, height, margin, len(curve))
    if best is None or best[0] > FARTHEST * margin:
        where = "" if best is None else f" near {target[best[3].argmax()].round(0).tolist()}"
        raise SurfaceError(
            f"{film.rim.name}: the film does not go on smoothly beyond its rim by {margin:.0f} mm"
            f"{where}; choose smaller panels or round the rim off there"
        )
    worst, outer, at, _ = best
    away, beside = cKDTree(edge.points).query(outer.points)
    reached = float((away / share[beside]).min())
    return ExtendedFilm(outer.surface, Disc(), film, reached, worst, at)


def _feet(
    surface: MinimalSurface, target: FloatArray
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Return foot points of (n, 3), signed heights above the surface and distances."""
    radii = 1 - np.linspace(0.0, 0.8, 14) ** 1.5
    grid = (radii[:, None] * np.exp(2j * np.pi * np.arange(256) / 256)).ravel()
    guess = grid[cKDTree(surface.point(grid)).query(target)[1]]
    at = surface.closest_parameter(target, guess)
    gap = target - surface.point(at)
    return at, (gap * surface.normal(at)).sum(1), np.linalg.norm(gap, axis=1)


def _corrected(
    outer: DiscFilm, at: ComplexArray, height: FloatArray, margin: float, samples: int
) -> Rim:
    """Return the outer rim, moved along the normals so that the film rises by ``height``.

    A small normal movement spreads over the film like a harmonic function.
    """
    count = int(np.clip(2 * outer.surface.scale / margin, 16, len(at) // 4))
    powers = at[:, None] ** np.arange(count)
    table = np.hstack([powers.real, -powers.imag[:, 1:]])
    k = np.arange(count)
    limit = DAMPED * np.sqrt(len(at)) * np.sqrt(1 + (k / (0.5 * count)) ** 2)
    rows = np.diag(np.concatenate([limit, limit[1:]]))
    rise = np.linalg.lstsq(
        np.vstack([table, rows]), np.concatenate([height, np.zeros(len(rows))]), rcond=None
    )[0]
    z = np.exp(1j * outer.angles)
    circle = z[:, None] ** np.arange(count)
    move = np.hstack([circle.real, -circle.imag[:, 1:]]) @ rise
    shift = move[:, None] * outer.surface.normal(z * (1 - 1e-12))
    t = outer.boundary % 1.0
    order = np.argsort(t)
    t, shift = t[order], shift[order]
    keep = np.append(True, np.diff(t) > 1e-12)
    t, shift = t[keep], shift[keep]
    t = np.concatenate([t[-3:] - 1, t, t[:3] + 1])
    shift = np.concatenate([shift[-3:], shift, shift[:3]])
    even, points = outer.rim.samples(samples)
    shift = averaged(CubicSpline(t, shift)(even), 0.2 * margin * samples / outer.rim.length)
    return Rim.through(points + shift, name=outer.rim.name)

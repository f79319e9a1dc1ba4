"""Triply periodic minimal surfaces in closed form: Schwarz' P and D and Schoen's gyroid.

The three are associates of each other, g = z and f = e^{iθ}/√(z⁸ − 14z⁴ + 1) with θ = 90° for P,
0° for D and cot θ = K'/K for the gyroid, K and K' of the modulus 1/2. The eight roots, where f
branches, are the Gauss images of the flat points: the corners of a cube.

Here every surface is taken about a flat point, with the Gauss map g = h² in a frame whose third
axis points against the normal there: h uniformises the branch, and

    φ = c (1 − h⁴, i(1 + h⁴), 2h²) / √(1 − k h⁶ − h¹²) dh,    k = 7/√8,

is holomorphic for |h| < 2^(-1/4), where the nearest other flat points are. The part whose normals
lie in one octant is a patch with six corners; it and its images under half-turns about the
normals at the middles of its six sides make up the whole surface, for each of the three alike.

References
----------
H. A. Schwarz, Gesammelte Mathematische Abhandlungen I (1890).
A. H. Schoen, Infinite periodic minimal surfaces without self-intersections, NASA TN D-5541 (1970).
A. Fogden, S. T. Hyde, Acta Crystallographica A48 (1992) 442-451, 575-591.
P. J. F. Gandy, J. Klinowski, Exact computation of the triply periodic G (gyroid) minimal surface,
Chemical Physics Letters 321 (2000) 363-371.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipk

from phexfab.errors import SurfaceError
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.weierstrass import MinimalSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

PERIODIC = ("schwarz-p", "schwarz-d", "gyroid")

_K, _K1 = float(ellipk(0.25)), float(ellipk(0.75))

_BRANCH = 7 / np.sqrt(8)
_REACH = 2**-0.25
"""Distance in h from a flat point to the nearest others, where the power series end."""

_LIMIT = 0.97 * _REACH

# Normals are R @ N, N the normal in the frame of the flat point: there it is (1, 1, 1)/√3, and
# real h > 0 leads to the normal (1, 1, 0)/√2.
_FRAME = np.array([[1, 1, -2], [np.sqrt(3), -np.sqrt(3), 0], [-np.sqrt(2)] * 3]).T / np.sqrt(6)

CORNER = np.sqrt((np.sqrt(6) - np.sqrt(2)) / 2) * np.exp(1j * np.pi / 3 * (np.arange(6) - 0.5))
"""h of the corners of a patch; their normals are (0, 1, 0), (1, 0, 0), (0, 0, 1), …"""

MIDDLE = np.sqrt(np.sqrt(3) - np.sqrt(2)) * np.exp(1j * np.pi / 3 * np.arange(6))
"""h of the middles of a patch's sides; side j goes from corner j to corner j + 1."""


def _check(name: str) -> str:
    if name not in PERIODIC:
        raise SurfaceError(
            f"surface.periodic: there is no periodic surface {name!r}; choose one of "
            f"{', '.join(PERIODIC)}"
        )
    return name


def bonnet_angle(name: str) -> float:
    """Return θ of f = e^{iθ}/√(z⁸ − 14z⁴ + 1), in degrees: 0 for D, 90 for P, 38.01477… for G.

    Raises
    ------
    SurfaceError
        If there is no periodic surface of that name.
    """
    gyroid = float(np.degrees(np.arctan2(_K, _K1)))
    return {"schwarz-p": 90.0, "schwarz-d": 0.0, "gyroid": gyroid}[_check(name)]


def periodic_area(name: str, cell: float = 1.0) -> float:
    """Return the area in one cubic cell, in mm² for a cell edge in mm.

    The cell is that of the translations which keep the two sides of the surface apart: it holds
    one primitive cell of P, four of D and two of the gyroid.

    Raises
    ------
    SurfaceError
        If there is no periodic surface of that name.
    """
    ratio = _K1 / _K
    areas = {"schwarz-p": 3 / ratio, "schwarz-d": 3 * ratio, "gyroid": 1.5 * (ratio + 1 / ratio)}
    return areas[_check(name)] * cell**2


def periodic_patch(name: str, cell: float = 1.0) -> MinimalSurface:
    """Return the surface about a flat point, which is at h = 0 and at the origin.

    Parameters
    ----------
    name : str
        "schwarz-p", "schwarz-d" or "gyroid".
    cell : float
        Edge of the cubic cell, in mm.

    Returns
    -------
    MinimalSurface
        Its parameter is h, with |h| < 0.81; axes are those of the cubic cell, the normal at the
        origin is (1, 1, 1)/√3. The patch of the tiling has its corners at |h| = 0.7195. X, N and
        Q are in closed form; w is counted from the middle of a side, h = 0.5638.

    Raises
    ------
    SurfaceError
        If there is no periodic surface of that name, or the cell is not positive.
    """
    angle = np.radians(bonnet_angle(name))
    edge = {
        "schwarz-p": _K1,
        "schwarz-d": 2 * _K,
        "gyroid": 2 * _K * _K1 / np.hypot(_K, _K1),
    }[name]
    if not 0 < cell < np.inf:
        raise SurfaceError(f"{name}: the edge of the cubic cell must be positive, not {cell}")
    # With this factor the edges of the cells are the complete elliptic integrals above.
    factor = 1j * np.exp(1j * angle) * np.sqrt(3 / (2 * np.sqrt(2))) / edge
    p, q = _spinor(_FRAME)

    def root(h: ComplexArray) -> ComplexArray:
        # Two factors: each has its cuts on rays outwards from the flat points.
        power = h**6
        return np.sqrt(1 - np.sqrt(8) * power) * np.sqrt(1 + power / np.sqrt(8))

    def bottom(h: ComplexArray) -> ComplexArray:
        return np.conj(p) - np.conj(q) * h * h

    def null_curve(h: ComplexArray) -> ComplexArray:
        return factor * _primitive(h) @ _FRAME.T

    umbilics = [_REACH * np.exp(1j * np.pi / 3 * j) for j in range(6)]
    umbilics += [np.exp(1j * np.pi / 3 * (j + 0.5)) / _REACH for j in range(6)]
    return MinimalSurface(
        name=name,
        gauss_map=lambda h: (p * h * h + q) / bottom(h),
        gauss_map_derivative=lambda h: 2 * h / bottom(h) ** 2,
        form=lambda h: 2 * factor * bottom(h) ** 2 / root(h),
        null_curve=null_curve,
        base=complex(MIDDLE[0]),
        rectangle=tuple(0.28 / np.sqrt(edge) * np.array([-1.0, 1.0, -1.0, 1.0])),
        singular=(0.0, *map(complex, umbilics)),
    ).scaled(cell)


def _spinor(turn: FloatArray) -> tuple[complex, complex]:
    """Return (p, q) so that a rotation acts on the Gauss map by g -> (p g + q)/(p̄ − q̄ g)."""
    # |trace + 1| is 4w²; the frame used here is far from a half-turn.
    w = 0.5 * np.sqrt(1 + np.trace(turn))
    x, y, z = ((turn[k, j] - turn[j, k]) / (4 * w) for j, k in ((1, 2), (2, 0), (0, 1)))
    return complex(w, z), complex(-y, x)


@lru_cache(maxsize=1)
def _series() -> FloatArray:
    """Return the coefficients of (1 − k x − x²)^(-1/2) in x, enough for |h| up to the limit."""
    count = 224
    c = np.zeros(count)
    c[0], c[1] = 1.0, _BRANCH / 2
    for n in range(2, count):
        c[n] = (_BRANCH * (n - 0.5) * c[n - 1] + (n - 1) * c[n - 2]) / n
    return c


def _primitive(h: ArrayLike) -> ComplexArray:
    """Return ∫ (1 − h⁴, i(1 + h⁴), 2h²)/√(1 − k h⁶ − h¹²) dh from 0, (..., 3)."""
    h = np.asarray(h, complex)
    far = float(np.abs(h).max(initial=0.0))
    if not far <= _LIMIT:
        raise SurfaceError(
            f"a patch of a periodic surface reaches to |h| = {_LIMIT:.3f} about its flat point, "
            f"not to {far:.3f}; go on in a neighbouring patch, or use a film of whole cells"
        )
    reach = far / _REACH
    count = int(np.ceil(np.log(1e-18) / (6 * np.log(max(reach, 0.1))))) + 1
    c, n = _series()[:count], 6 * np.arange(min(count, len(_series())))
    x = h**6
    sums = [np.zeros_like(x) for _ in range(3)]
    for k in range(len(n) - 1, -1, -1):
        for j, power in enumerate((1, 5, 3)):
            sums[j] = sums[j] * x + c[k] / (n[k] + power)
    low, high, middle = h * sums[0], h**5 * sums[1], 2 * h**3 * sums[2]
    return np.stack([low - high, 1j * (low + high), middle], -1)


@dataclass(frozen=True, eq=False)
class PeriodicSurface:
    """A triply periodic surface as a tiling: eight patches and the translations of its lattice.

    Lengths are in edges of the cubic cell. Coordinates are those in which the surface is near
    F = 0 and its normals point to F > 0:

        schwarz-p   F = −cos x − cos y − cos z
        schwarz-d   F = sin x cos(y − z) + cos x sin(y + z)
        gyroid      F = sin x cos y + sin y cos z + sin z cos x

    with one period 2π along an edge of the cell.

    Attributes
    ----------
    name : str
    patch : MinimalSurface
        About one flat point, see `periodic_patch`, with cell edge 1.
    turns : (8, 3, 3) float
        Rotations of the patch, one per octant of normals; entries 0 and ±1.
    centres : (8, 3) float
        Flat points of these patches.
    cosets : (c, 3) float
        Translations of the lattice inside one cubic cell: 1 for P, 4 for D, 2 for the gyroid.
    corner : (3,) float
        Where the customary cell begins.
    """

    name: str
    patch: MinimalSurface
    turns: FloatArray
    centres: FloatArray
    cosets: FloatArray
    corner: FloatArray

    def place(self, octants: IntArray, shifts: FloatArray, h: ComplexArray) -> FloatArray:
        """Return the points (..., 3) of parameters h (...) on the given images of the patch."""
        local = np.einsum("...ij,...j->...i", self.turns[octants], self.patch.point(h))
        return local + self.centres[octants] + shifts

    def parameter(
        self, octants: IntArray, normals: FloatArray, guess: ComplexArray
    ) -> ComplexArray:
        """Return the h (...) of normals (..., 3) on images of the patch, on the guess's sheet."""
        frames = self.turns[octants] @ _FRAME
        x, y, z = np.moveaxis(np.einsum("...ji,...j->...i", frames, normals), -1, 0)
        h = np.sqrt((x + 1j * y) / (1 - z))
        return np.where((h * np.conj(guess)).real < 0, -h, h)


@lru_cache(maxsize=len(PERIODIC))
def periodic_surface(name: str) -> PeriodicSurface:
    """Return the tiling of a periodic surface by its name.

    Raises
    ------
    SurfaceError
        If there is no periodic surface of that name.
    """
    patch = periodic_patch(name)
    middles, normals = patch.point(MIDDLE[:3]), patch.normal(MIDDLE[:3])
    half_turns = np.rint(2 * normals[:, :, None] * normals[:, None, :] - np.eye(3))
    # Flat points have coordinates in quarters of the cell, to rounding: make them exact.
    steps = np.rint(4 * (middles - np.einsum("kij,kj->ki", half_turns, middles))) / 4
    start = np.full(3, 0.25 if name == "schwarz-p" else 0.0)
    found = {(1, 1, 1): (np.eye(3), start)}
    queue = list(found)
    while queue:
        turn, centre = found[queue.pop(0)]
        for half_turn, step in zip(half_turns, steps, strict=True):
            beyond = turn @ half_turn
            x, y, z = (int(s) for s in beyond.sum(axis=1))
            octant = (x, y, z)
            if octant not in found:
                found[octant] = (beyond, centre + turn @ step)
                queue.append(octant)
    halves = {
        "schwarz-p": [[0, 0, 0]],
        "schwarz-d": [[0, 0, 0], [0, 1, 1], [1, 0, 1], [1, 1, 0]],
        "gyroid": [[0, 0, 0], [1, 1, 1]],
    }[name]
    # P: mirror planes through the necks. D: planes through straight lines; corners are nodes of one
    # labyrinth, as atoms in diamond. G: near the planes that
    # the film crosses most steeply (within 35° of the normal), no flat point on the cut.
    corner = {
        "schwarz-p": [0.5, 0.5, 0.5],
        "schwarz-d": [0.25, 0.25, 0.25],
        "gyroid": [1 / 128, 1 / 128, 33 / 128],
    }
    return PeriodicSurface(
        name,
        patch,
        np.array([turn for turn, _ in found.values()]),
        np.array([centre for _, centre in found.values()]),
        np.array(halves) / 2,
        np.array(corner[name], float),
    )

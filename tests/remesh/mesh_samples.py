"""Triangle meshes of exact minimal surfaces, with exact normals and principal directions."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial import Delaunay

import phexfab as px
from phexfab.surface.construct import from_weierstrass


@dataclass
class Sample:
    """A mesh and, where one parameter domain covers it, the surface and its parameters."""

    points: Any
    triangles: Any
    normals: Any
    directions: Any
    curvatures: Any
    surface: Any = None
    z: Any = None
    extra: dict = field(default_factory=dict)

    @property
    def arrays(self):
        return self.points, self.triangles, self.normals, self.directions, self.curvatures


def sampled(surface, z, triangles, like=None):
    """Sample a surface at parameters z; triangles counter-clockwise in the parameter plane."""
    q = surface.hopf(z)
    along = surface.tangent(z) / np.sqrt(np.where(q == 0, 1.0, q))[:, None]
    d = along.real
    d /= np.linalg.norm(d, axis=1)[:, None]
    kappa = np.abs(q) * surface.scale / surface.conformal_factor(z) ** 2
    return Sample(surface.point(z), triangles, surface.normal(z), d, kappa, surface, z)


def disc(radius, rings, turn=0.1):
    """A mesh of a disc in the plane, nothing aligned with an axis."""
    z = [np.zeros(1, complex)]
    for k in range(1, rings + 1):
        n = 6 * k
        z.append(k / rings * np.exp(2j * np.pi * (np.arange(n) + 0.5 * (k % 2)) / n + 1j * turn))
    z = radius * np.concatenate(z)
    tri = Delaunay(np.column_stack([z.real, z.imag])).simplices
    return z, oriented(z, tri)


def oriented(z, tri):
    a, b, c = (z[tri[:, k]] for k in range(3))
    area = ((b - a).conj() * (c - a)).imag
    return np.where((area < 0)[:, None], tri[:, ::-1], tri)[np.abs(area) > 1e-14]


def ring(n, rows, width, period):
    """A mesh of a strip [−width, width] × [0, period) that closes, in w; triangles wrap."""
    u = np.linspace(-width, width, rows)
    i, j = np.meshgrid(np.arange(rows), np.arange(n), indexing="ij")
    w = (u[i] + 1j * period * (j + 0.5 * (i % 2)) / n).ravel()
    faces = []
    for r in range(rows - 1):
        a, b = r * n + np.arange(n), r * n + (np.arange(n) + 1) % n
        c, d = a + n, b + n
        if r % 2 == 0:
            faces += [np.column_stack(f) for f in ((a, c, b), (b, c, d))]
        else:
            faces += [np.column_stack(f) for f in ((a, c, d), (a, d, b))]
    return w, np.concatenate(faces)


def catenoid(n=60, rows=25, width=1.0, scale=1000.0):
    surface = px.minimal_surface("catenoid").scaled(scale)
    period = abs(surface.period)
    w, tri = ring(n, rows, width, period)
    if abs(surface.period.real) > 0:
        w = 1j * w.conjugate()
    z = surface.parameter(w)
    made = sampled(surface, z, tri)
    return facing(made)


def facing(sample):
    a, b, c = (sample.points[sample.triangles[:, k]] for k in range(3))
    side = np.einsum("ij,ij->i", np.cross(b - a, c - a), sample.normals[sample.triangles[:, 0]])
    if np.median(side) < 0:
        sample.triangles = sample.triangles[:, ::-1].copy()
    return sample


def enneper(order, rings=40, radius=0.8, scale=1000.0, centre=0.0):
    surface = px.minimal_surface("enneper", order=order).scaled(scale)
    z, tri = disc(radius, rings)
    return sampled(surface, z + centre, tri)


def many_umbilics(zeros, rings=45, radius=1.0, scale=1000.0, tilt=0.3):
    """The surface with f = 1 and g' = tilt·∏(z − zero): umbilics exactly at the zeros."""
    slope = tilt * np.poly(np.asarray(zeros, complex))
    g = np.polyint(slope)
    square, prod = np.polyint(np.polymul(g, g)), np.polyint(g)

    def curve(z):
        b, c = np.polyval(square, z), np.polyval(prod, z)
        return np.stack([(z - b) / 2, 1j * (z + b) / 2, c], -1)

    surface = from_weierstrass(
        lambda z: np.polyval(g, z),
        lambda z: np.ones_like(z),
        base=0.37 + 0.11j,
        gauss_map_derivative=lambda z: np.polyval(slope, z),
        null_curve=curve,
        scale=scale,
    )
    z, tri = disc(radius, rings)
    return sampled(surface, z, tri)


def schwarz_p_octant(rings, scale=1000.0):
    """An eighth of a cell of Schwarz' P surface around its flat point, with its exact surface.

    With the normal (1, 1, 1)/√3 at the pole g = 0 the Hopf differential is c·dg²/√R(g), R having
    the eight normals (±1, ±1, ±1)/√3 as zeros; g = ζ² removes the root. The octant of normals,
    covered twice, is the part between mirror planes.
    """
    signs = np.array([[a, b, c] for a in (1, -1) for b in (1, -1) for c in (1, -1)], float)
    third = -np.ones(3) / np.sqrt(3)  # south pole: g = 0
    first = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    frame = np.stack([first, np.cross(-third, first), -third])
    north = signs @ frame.T / np.sqrt(3)
    # Our g is stereographic from the north pole: N = (1, 1, 1)/√3 has g = ∞, its opposite g = 0.
    north = north[np.abs(north[:, 2]) < 0.999]
    other = (north[:, 0] + 1j * north[:, 1]) / (1 - north[:, 2])

    def root(z):
        return np.prod(np.sqrt(1 - np.asarray(z)[..., None] ** 2 / other), axis=-1)

    # Corners of the octant of normals opposite to (1, 1, 1): −e_x, −e_y, −e_z.
    corner = -np.eye(3) @ frame.T
    gc = (corner[:, 0] + 1j * corner[:, 1]) / (1 - corner[:, 2])
    gc = gc[np.argsort(np.angle(gc))]
    # This phase makes Q real along the octant's sides: they are planar geodesics (P, and not D).
    phase = np.exp(-0.25j * np.pi)
    made = from_weierstrass(
        lambda z: z**2,
        lambda z: phase / root(z),
        base=0.05,
        gauss_map_derivative=lambda z: 2 * z,
        scale=scale,
    )
    z, tri = disc(1.0, rings, turn=0.0)
    # The unit disc to the double cover of the octant: radially, its rim to the great circles.
    angle = np.angle(z)
    reach = np.empty(len(z))
    spread = np.mod(2 * angle - np.angle(gc[0]), 2 * np.pi)
    third_turn = 2 * np.pi / 3
    within = np.mod(spread, third_turn)
    reach = np.sqrt(_ray(gc, within))
    return made, frame, z * reach, tri


def _lift(g):
    g = np.asarray(g)
    return (
        np.stack([2 * g.real, 2 * g.imag, np.abs(g) ** 2 - 1], -1) / (1 + np.abs(g) ** 2)[..., None]
    )


def _ray(gc, angle):
    """|g| where the ray at an angle from the first corner meets the great circle to the next."""
    plane = np.cross(_lift(gc[0]), _lift(gc[1]))
    ray = np.exp(1j * (angle + np.angle(gc[0])))
    # plane · (2 r cos, 2 r sin, r² − 1) = 0
    linear = 2 * (plane[0] * ray.real + plane[1] * ray.imag)
    c = plane[2]
    disc_ = np.sqrt(linear**2 + 4 * c * c)
    return np.where(c > 0, (-linear + disc_) / (2 * c), (-linear - disc_) / (2 * c))


def schwarz_p(rings=12, cells=(1, 1, 1), scale=1000.0, skip=()):
    """A block of cells of Schwarz' P surface; every triangle knows its exact piece of it."""
    surface, frame, z, tri = schwarz_p_octant(rings, scale)
    base = facing(sampled(surface, z, tri))
    x, n, d = base.points @ frame, base.normals @ frame, base.directions @ frame
    low, high = x.min(axis=0), x.max(axis=0)
    size = float((high - low).mean())
    x = x - low
    for wall in (0.0, size):  # exactly on the mirror planes, so that copies weld
        x[np.abs(x - wall) < 1e-6 * size] = wall
    made = {key: [] for key in ("points", "normals", "directions", "triangles", "signs", "place")}
    count = 0
    for cell in np.ndindex(*cells):
        if cell in skip:
            continue
        for mirror in np.ndindex(2, 2, 2):
            signs = 1.0 - 2 * np.array(mirror)
            made["points"].append(x * signs + 2 * size * np.array(cell))
            made["normals"].append(n * signs)
            made["directions"].append(d * signs)
            odd = sum(mirror) % 2
            made["triangles"].append(base.triangles[:, :: -1 if odd else 1] + count)
            made["signs"].append(np.broadcast_to(signs, (len(tri), 3)))
            made["place"].append(
                np.broadcast_to(2 * size * np.array(cell) - signs * low, (len(tri), 3))
            )
            count += len(x)
    joined = {key: np.concatenate(value) for key, value in made.items()}
    grid = np.rint(joined["points"] / (1e-5 * size)).astype(np.int64)
    _, first, number = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    sample = Sample(
        joined["points"][first],
        number.reshape(-1)[joined["triangles"]],
        joined["normals"][first],
        joined["directions"][first],
        np.tile(base.curvatures, len(made["points"]))[first],
        surface,
    )
    z_corner = np.tile(z, len(made["points"]))[joined["triangles"]]
    sample.extra = {**joined, "z": z_corner, "frame": frame, "size": size}
    return sample


def exact(sample, lattice):
    """Return the exact surface's points and normals at the lattice points of a mesh."""
    if "z" not in sample.extra:
        z = lattice.on_mesh(sample.z, sample.triangles)
        if lattice.lattice.closed:  # parameters jump across the seam
            corner = sample.z[sample.triangles[lattice.face, lattice.barycentric.argmax(axis=1)]]
            z = sample.surface.closest_parameter(
                lattice.on_mesh(sample.points, sample.triangles), corner
            )
        return sample.surface.point(z), sample.surface.normal(z)
    extra = sample.extra
    z = (extra["z"][lattice.face] * lattice.barycentric).sum(axis=1)
    signs, place = extra["signs"][lattice.face], extra["place"][lattice.face]
    x = sample.surface.point(z) @ extra["frame"]
    return x * signs + place, sample.surface.normal(z) @ extra["frame"] * signs

"""Parts for the CAD tests: non-convex panels, mitred bars, hubs, placed anywhere in space."""

import numpy as np

from phexfab.fabrication.parts import (
    Beam,
    Cylinder,
    EdgeNote,
    FlatPart,
    Material,
    Node,
    Panel,
    Parts,
    Solid,
)

STEEL = Material("steel", 7850.0)


def prism_faces(n):
    """Faces of a prism-like solid: lower ring 0…n−1, upper ring n…2n−1."""
    sides = [(k, (k + 1) % n, (k + 1) % n + n, k + n) for k in range(n)]
    return (tuple(range(n - 1, -1, -1)), tuple(range(n, 2 * n)), *sides)


def placed(points, rng, reach=3000.0):
    """Turn and move points at random, by an exact-to-rounding rotation."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    q[:, 0] *= np.sign(np.linalg.det(q))
    return points @ q.T + rng.uniform(-reach, reach, 3)


def hexagon(rng):
    """A hexagon with two reflex corners."""
    angle = np.arange(6) * np.pi / 3
    radius = np.array([300.0, 300, 110, 300, 300, 110]) * rng.uniform(0.9, 1.1, 6)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def panel_solid(rng, reach=3000.0):
    """A non-convex hexagonal panel, 8 mm thick, its edges mitred as a frustum."""
    outline = hexagon(rng)
    lower = np.column_stack([outline, np.zeros(6)])
    upper = np.column_stack([outline * rng.uniform(0.97, 1.03), np.full(6, 8.0)])
    return Solid(placed(np.vstack([lower, upper]), rng, reach), prism_faces(6))


def beam_solid(rng):
    """A 10 × 90 bar: hexagonal top and bottom, two end faces at each end, ends sloped."""
    length = rng.uniform(200, 400)
    half, tip = 5.0, rng.uniform(2.0, 4.0)
    x = np.array([0.0, tip, length - tip, length, length - tip, tip])
    y = np.array([0.0, -half, -half, 0.0, half, half])
    first, last = rng.uniform(-6, 6, 2)
    shift = np.array([first, first, last, last, last, first])
    lower = np.column_stack([x, y, np.zeros(6)])
    upper = np.column_stack([x + shift, y, np.full(6, 90.0)])
    return Solid(placed(np.vstack([lower, upper]), rng), prism_faces(6))


def panel(mark, solid):
    outline = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    sides = (EdgeNote("", 0.0),) * (len(solid.vertices) // 2)
    flat = FlatPart(mark, outline, outline, sides, 8.0, STEEL)
    return Panel(mark, 0, solid, flat, 0.0, 0.0, 0.0)


def beam(mark, solid):
    flat = panel(mark, solid).flat
    square = ((0.0, 0.0), (0.0, 0.0))
    return Beam(mark, 0, ("", ""), (), solid, flat, 0.0, square, (0.0, 0.0), 0.0, 0.0)


def node(mark, rng, axis=None):
    axis = rng.normal(size=3) if axis is None else np.asarray(axis, float)
    cylinder = Cylinder(
        rng.uniform(-3000, 3000, 3), axis / np.linalg.norm(axis), rng.uniform(15, 30), 90.0
    )
    return Node(mark, 0, cylinder, STEEL, (), 0.0, 0.0)


def sample_parts(panels=7, beams=6, nodes=5, seed=4):
    """Panels (one a pentagon, so that topologies mix), beams, and hubs along and off the axes."""
    rng = np.random.default_rng(seed)
    solids = [panel_solid(rng) for _ in range(panels)]
    five = np.array([[0.0, 0], [400, 0], [400, 300], [180, 90], [0, 300]])
    prism = np.vstack([np.c_[five, np.zeros(5)], np.c_[five, np.full(5, 8.0)]])
    solids[1] = Solid(placed(prism, rng), prism_faces(5))
    axes = [None, [0, 0, 1], [-1, 0, 0], [0, 1, 1]]
    return Parts(
        tuple(panel(f"P{k:03d}", s) for k, s in enumerate(solids, 1)),
        tuple(beam(f"B{k:03d}", beam_solid(rng)) for k in range(1, beams + 1)),
        tuple(node(f"N{k:03d}", rng, axes[k % 4]) for k in range(1, nodes + 1)),
    )


def geometries(parts):
    """Marks and geometry of all parts, in order."""
    out = {p.mark: p.solid for p in (*parts.panels, *parts.beams)}
    return out | {n.mark: n.cylinder for n in parts.nodes}


def exact_volume(geometry):
    """Volume by the divergence theorem, one face at a time; π r² h for a cylinder."""
    if isinstance(geometry, Cylinder):
        return np.pi * geometry.radius**2 * geometry.length
    points = geometry.vertices - geometry.vertices.mean(axis=0)
    total = 0.0
    for face in geometry.faces:
        corners = points[list(face)]
        area = 0.5 * np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
        total += corners.mean(axis=0) @ area / 3
    return total

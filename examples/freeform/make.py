"""Writes what freeform-roof.toml and planarised-panels.toml begin with: roof.step, panels.obj.

Run it from anywhere: ``python examples/freeform/make.py``.
"""

from pathlib import Path

import cadquery as cq
import numpy as np

HERE = Path(__file__).parent


def vault(x: float, y: float) -> float:
    """Return the height of a vault that waves along x, so that K > 0 on crests and < 0 between."""
    across = 3000 * np.cos(np.pi * y / 14000 * (1 + x / 350000))
    along = 260 * np.cos(2 * np.pi * (x + 500) / 14000) + 120 * np.sin(np.pi * x / 9000)
    return float(across + along)


def roof() -> None:
    """Write roof.step: a spline through 15 × 11 points of the vault."""
    points = [
        [cq.Vector(x, y, vault(x, y)) for y in np.linspace(-5000, 5000, 11)]
        for x in np.linspace(-7000, 7000, 15)
    ]
    face = cq.Face.makeSplineApprox(points, tol=1e-3, minDeg=3, maxDeg=5)
    cq.exporters.export(cq.Workplane(obj=face), str(HERE / "roof.step"))


def panels() -> None:
    """Write panels.obj: a honeycomb dropped on a dome, bent by noise, each face on its own."""
    step, noise = 900.0, np.random.default_rng(5)
    flatter = np.array([1.0, 1 / np.sqrt(1.3)])  # faces are nearly planar where they are dual to K
    down = step * np.sqrt(3) / 2
    ring = np.arange(6) * np.pi / 3 + np.pi / 6
    corners = step / np.sqrt(3) * np.column_stack([np.cos(ring), np.sin(ring)])
    middles = [
        (step * (i + j % 2 / 2), down * j)
        for j in range(-6, 7)
        for i in range(-7, 8)
        if abs(i + j % 2 / 2) * step < 5600
    ]
    moves: dict[tuple[int, int], np.ndarray] = {}  # a corner moves alike in all of its faces
    lines = ["# mm; a dome of hexagons that are not planar, their corners not joined"]
    for middle in middles:
        for x, y in (corners + middle) * flatter:
            move = moves.setdefault((round(x), round(y)), noise.normal(scale=4.0, size=3))
            z = 2400 - (x * x + 1.3 * y * y) / 20000
            lines.append("v {:.4f} {:.4f} {:.4f}".format(*(np.array([x, y, z]) + move)))
    lines += ["f " + " ".join(str(6 * f + k) for k in range(1, 7)) for f in range(len(middles))]
    (HERE / "panels.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    roof()
    panels()

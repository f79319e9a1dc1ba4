"""Flat parts for the nesting tests: hourglass hexagons as on minimal surfaces, and bars."""

import numpy as np

from phexfab.fabrication.parts import EdgeNote, FlatPart, Material

HPL = Material("HPL", 1350.0)
STEEL = Material("S235", 7850.0)


def turn(points, degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return points @ np.array([[c, s], [-s, c]])


def hourglass(size):
    """A hexagon with angles 60 60 240 60 60 240: the width is √3·size, the sides are 2·size."""
    h = size * np.sqrt(3) / 2
    return np.array([(-h, -size), (0, -size / 2), (h, -size), (h, size), (0, size / 2), (-h, size)])


def part(mark, outline, material=HPL, thickness=8.0, blank=None):
    notes = tuple(EdgeNote("P000", 0.0) for _ in outline)
    return FlatPart(mark, outline, outline if blank is None else blank, notes, thickness, material)


def panels(count, low, high, seed, wobble=0.06):
    """Perturbed hourglass hexagons of mixed sizes, each turned its own way."""
    rng = np.random.default_rng(seed)
    made = []
    for k in range(count):
        size = rng.uniform(low, high)
        outline = hourglass(size) + rng.uniform(-wobble, wobble, (6, 2)) * size
        made.append(part(f"P{k:03d}", turn(outline, rng.uniform(0, 360))))
    return made


def bars(count, seed=0):
    """Mitred flat bars, 90 mm high and 200 to 500 mm long."""
    rng = np.random.default_rng(seed)
    made = []
    for k in range(count):
        length = rng.uniform(200, 500)
        a, b, c, d = rng.uniform(-4, 4, 4)
        outline = np.array([(a, 0), (length + b, 0), (length + c, 90), (d, 90)])
        made.append(part(f"B{k:04d}", outline, STEEL, 10.0))
    return made


def lying(sheet, flats):
    """Blanks where they lie, computed apart from the code under test (complex numbers)."""
    parts = {flat.mark: flat for flat in flats}
    found = {}
    for p in sheet.placements:
        z = parts[p.mark].blank @ np.array([1, 1j])
        w = z * np.exp(1j * np.radians(p.angle)) + complex(p.x, p.y)
        found[p.mark] = np.column_stack([w.real, w.imag])
    return found

"""Densities of common materials, so that a design file may name one and leave its density out.

Nominal values from manufacturers' tables and EN 1991-1-1 annex A; a design that needs its own
figure gives ``density``.
"""

from __future__ import annotations

# Name -> density in kg/m³.
MATERIALS: dict[str, float] = {
    "steel S235": 7850.0,
    "steel S355": 7850.0,
    "weathering steel": 7850.0,
    "stainless steel": 7900.0,
    "aluminium": 2700.0,
    "brass": 8500.0,
    "copper": 8900.0,
    "titanium": 4500.0,
    "HPL": 1350.0,
    "fibre cement": 1750.0,
    "glass": 2500.0,
    "acrylic": 1190.0,
    "polycarbonate": 1200.0,
    "GRP": 1850.0,
    "plywood": 600.0,
    "birch plywood": 680.0,
    "MDF": 750.0,
    "spruce": 450.0,
    "oak": 700.0,
    "glulam": 450.0,
    "cardboard": 700.0,
}
_BY_LOWER = {name.lower(): density for name, density in MATERIALS.items()}


def known_density(name: str) -> float | None:
    """Return the density of a named material in kg/m³, or None; capitals do not matter."""
    return _BY_LOWER.get(name.strip().lower())

"""Conformal hexagons (5.3): multi-ratios, duals, meshes from two commuting similarities."""

"""P-Hex computation: lattices, tangent and Dupin duality, conjugate curves, planarity."""

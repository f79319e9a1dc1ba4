"""Surfaces that are not minimal: parametric, NURBS, implicit, triangle meshes."""

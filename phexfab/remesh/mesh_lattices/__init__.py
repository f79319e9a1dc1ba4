"""Lattices of films on triangle meshes, of any topology."""

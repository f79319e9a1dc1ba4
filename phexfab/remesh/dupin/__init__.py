"""Dupin duality (5.1): conics of triangles, ideal triangles, hexagons from a triangulation."""

"""Conjugate curves (5.2): networks on any surface, and hexagons laid in them like bricks."""

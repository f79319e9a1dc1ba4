"""Planar quad meshes (3.2): principal, circular and conical, refined by subdivision."""

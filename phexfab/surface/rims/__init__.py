"""Rims: closed boundary curves, read from tables, drawings and CAD models, checked and joined."""

"""Lattices of analytic films, closed up around any number of umbilics."""

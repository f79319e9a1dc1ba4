"""Adapters to CAD: B-rep solids, STEP, DXF, CadQuery and build123d objects.

Importing this package imports no CAD kernel; the functions that need one load it when called.
"""

"""Triply periodic minimal surfaces: Schwarz' P and D, Schoen's gyroid, any box of cells."""

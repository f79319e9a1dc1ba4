"""The nearest mesh of planar faces to any polygon mesh."""

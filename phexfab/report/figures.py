"""Pictures of shells, Gauss images, assemblies and sheets, as PNG bytes."""

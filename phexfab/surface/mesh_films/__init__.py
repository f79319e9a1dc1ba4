"""Films of any topology: least area on triangle meshes, then smooth by local minimal surfaces."""

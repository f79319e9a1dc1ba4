"""Films of the disc type: Plateau's problem for one rim, as a holomorphic null curve."""

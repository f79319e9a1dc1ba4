"""Valid triangulations (5.1.4), laid layer by layer along conjugate directions."""

"""The exhaustive search over the mounting angles: grid, coarse landscape, families, limits, parts."""

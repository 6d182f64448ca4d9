"""Cloud files: PLY, PCD, LAS, E57, NPZ, XYZ."""

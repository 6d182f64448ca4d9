"""Design of the scanner: task, catalogue, angle set, frames, beams, density, objective, search."""

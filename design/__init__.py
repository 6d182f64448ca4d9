"""What the scanner is: task, catalogue, angle set, frames, beams, density, objective, search."""

"""Score of a mount: problem, objectives, quadrature, score, and independent counts."""

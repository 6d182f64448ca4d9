"""Studies: combine tasks with products, and rank the candidates by their trade-offs."""

"""What a setting is judged by: the problem, objectives, quadrature, the score, and the ball search as oracle."""

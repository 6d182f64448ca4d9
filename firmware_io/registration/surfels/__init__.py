"""Final adjustment of a pair: the flat pieces that both stands saw, together with the pose, beam by beam."""

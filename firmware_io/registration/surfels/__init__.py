"""The last word on a pair: flat pieces that both stands saw, adjusted together with the pose, beam by beam."""

"""Final adjustment of a pair: the pose and the common flat surfaces, from the single beams."""

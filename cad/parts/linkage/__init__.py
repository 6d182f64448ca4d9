"""Parts that carry the lidar: the alignment linkage and what is screwed to it."""

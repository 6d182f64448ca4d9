"""Parts that carry the lidar: the alignment linkage and parts screwed to it."""

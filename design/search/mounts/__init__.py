"""Simple mounts: the four references, the gain of an answer over them, and the search's preference for them."""

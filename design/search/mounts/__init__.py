"""Simple mounts: the four references, the gain of a result over them, and the search's preference for them."""

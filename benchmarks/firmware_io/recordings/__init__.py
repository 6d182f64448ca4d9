"""Faults of other people's recordings: random ones against the import checks, and pictures of them."""

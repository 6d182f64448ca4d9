"""Paths of the cables: smooth paths, the space for them, a search through it. No kernel."""

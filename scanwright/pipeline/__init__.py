"""Builds: their stages, their folder `out/<task>/` and its manifest."""

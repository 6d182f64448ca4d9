"""Occupancy grids of clouds for navigation."""

"""Checks of imported bags, and their corrections."""

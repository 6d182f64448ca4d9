"""Loads on each drive, as checks."""

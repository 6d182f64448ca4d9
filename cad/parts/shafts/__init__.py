"""Turning parts between servo and linkage: shafts, sleeves and pulleys."""

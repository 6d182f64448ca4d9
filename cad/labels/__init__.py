"""Engraved labels: which flat can be read on the assembled scanner, the letters, and how they are cut."""

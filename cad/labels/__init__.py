"""Engraved labels: choice of a face that can be read on the assembled scanner, letters, and grooves."""

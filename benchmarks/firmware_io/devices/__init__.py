"""Devices of each family: what they say, when their beams were, and what the cheap scanner sees."""

"""Beams per ball: the fan, exact counts of a turning and of a sweeping scanner."""

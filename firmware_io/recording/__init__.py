"""Recordings: MCAP, bags in and out, repair."""

"""Recordings: reading and writing of MCAP, import and export of bags, repair."""

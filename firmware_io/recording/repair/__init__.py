"""Damaged recordings: what of them is whole, in a new file."""

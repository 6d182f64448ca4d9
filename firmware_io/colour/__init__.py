"""Colours of a cloud from camera images."""

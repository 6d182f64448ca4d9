"""Colours for a cloud from the images of a camera."""

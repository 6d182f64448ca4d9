"""Conversion of clouds: speed and memory."""

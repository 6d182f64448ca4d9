"""Emulated SICK lidars."""

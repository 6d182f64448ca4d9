"""Lidars: one folder a family."""

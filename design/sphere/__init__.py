"""Directions and their weights: points on the sphere, regions as fields."""

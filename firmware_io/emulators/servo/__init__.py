"""Emulated servos of each family, on one bus."""

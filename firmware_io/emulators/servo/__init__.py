"""Emulators of servos: the bus with its port, and how each family behaves on it."""

"""Servos: one folder a family, and the guard that takes the torque whatever happens."""

"""Servos: what everybody asks of one (`servo`), the guard that takes its torque, and one folder a family."""

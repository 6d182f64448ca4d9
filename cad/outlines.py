"""Corners of plane outlines. Millimetres. No kernel."""

import math

import numpy as np

from scanwright.design.arrays import Array


def diamond(half: float, y: float) -> Array:
    """Return a square on its corner about (0, y), shape (4, 2): it cuts a V into an edge at y."""
    return np.array([[half, y], [0.0, y + half], [-half, y], [0.0, y - half]])


def octagon(half_x: float, half_y: float, chamfer: float, y: float = 0.0) -> Array:
    """Return a rectangle about (0, y) with cut corners, counter-clockwise, shape (8, 2)."""
    a, b, c = half_x, half_y, chamfer
    corners = [[a, c - b], [a, b - c], [a - c, b], [c - a, b], [-a, b - c], [-a, c - b], [c - a, -b], [a - c, -b]]
    return np.array([[px, py + y] for px, py in corners])


def gable(half_width: float, low: float, high: float) -> Array:
    """Return a window with a roof of 45 deg, printable without support: (sideways, z), shape (5, 2)."""
    a, eaves = half_width, high - half_width
    return np.array([[-a, low], [a, low], [a, eaves], [0.0, high], [-a, eaves]])


def polygon(radius: float, sides: int, turn: float = 0.0) -> Array:
    """Return a regular polygon with its corners on `radius`, shape (sides, 2), the first one at `turn` [rad]."""
    angle = turn + 2 * math.pi * np.arange(sides) / sides
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)

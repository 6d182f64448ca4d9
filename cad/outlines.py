"""Outlines in a plane that the parts are made of, as corners. Millimetres. No kernel."""

from __future__ import annotations

import math

import numpy as np

from scanwright.design.arrays import Array


def diamond(half: float, y: float) -> Array:
    """Square on its corner about (0, y), shape (4, 2): cuts a V into what ends at y."""
    return np.array([[half, y], [0.0, y + half], [-half, y], [0.0, y - half]])


def octagon(half_x: float, half_y: float, chamfer: float, y: float = 0.0) -> Array:
    """Rectangle about (0, y) with cut corners, counter-clockwise, shape (8, 2)."""
    a, b, c = half_x, half_y, chamfer
    corners = [[a, c - b], [a, b - c], [a - c, b], [c - a, b], [-a, b - c], [-a, c - b], [c - a, -b], [a - c, -b]]
    return np.array([[px, py + y] for px, py in corners])


def gable(half_width: float, low: float, high: float) -> Array:
    """Upright window with a roof of 45 deg, which prints without support: (sideways, z) corners, shape (5, 2)."""
    a, eaves = half_width, high - half_width
    return np.array([[-a, low], [a, low], [a, eaves], [0.0, high], [-a, eaves]])


def polygon(radius: float, sides: int, turn: float = 0.0) -> Array:
    """Regular polygon with its corners on `radius`, shape (sides, 2); `turn` [rad] is its first corner."""
    angle = turn + 2 * math.pi * np.arange(sides) / sides
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)

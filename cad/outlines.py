"""Corners of plane outlines. Millimetres. No kernel."""

import math

import numpy as np
from numpy.typing import ArrayLike

from scanwright.design.arrays import Array

HAND, NOTCH = 3.0, 2.0  # radius of corners that hands meet, and of inner corners, where stress is highest
EDGE_SHARE = 0.45  # of an edge, at most, that the arc at either of its ends takes


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


def rounded(outline: ArrayLike, radius: ArrayLike) -> Array:
    """Return first, middle and last point of the arc at each corner, shape (n, 3, 2); without radius, the corner.

    `radius` is one for all corners or one for each; an arc takes less than half of the shorter edge next to it.
    """
    corners = np.asarray(outline, dtype=float)
    radii = np.broadcast_to(np.asarray(radius, dtype=float), len(corners))
    back, on = np.roll(corners, 1, axis=0) - corners, np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm([back, on], axis=2)
    back, on = back / lengths[0, :, None], on / lengths[1, :, None]
    half = np.arccos(np.clip(np.einsum("ij,ij->i", back, on), -1.0, 1.0)) / 2
    reach = np.minimum(radii / np.tan(half), EDGE_SHARE * lengths.min(axis=0))[:, None]
    inwards = (back + on) / np.linalg.norm(back + on, axis=1)[:, None]
    deep = reach * (1 / np.cos(half) - np.tan(half))[:, None]
    return np.stack([corners + reach * back, corners + deep * inwards, corners + reach * on], axis=1)

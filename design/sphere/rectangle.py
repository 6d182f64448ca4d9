"""A rectangle on a plane as the optical centre sees it: a spherical polygon of four arcs of great circles.

In a frame whose axes e1, e2 lie along its sides and whose third, n, points at its plane, its points at unit distance
are (x, y, 1). A strip of it at x = sinh t subtends the solid angle

    dO = (h(y1) - h(y0)) / cosh t dt,   h(y) = y / sqrt(1 + x^2 + y^2)

which neither a region far away nor a narrow one makes inexact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Vector

STRIPS = 2048  # of the solid angle's sum: an even number


@dataclass(frozen=True, slots=True)
class SeenRectangle:
    """The frame of a rectangle and its bounds there.

    Attributes:
        frame: rows e1, e2, n, shape (3, 3).
        x: from and to along e1, at unit distance.
        y: the same along e2.
    """

    frame: Float[ndarray, "3 3"]
    x: tuple[float, float]
    y: tuple[float, float]

    def corners(self) -> Float[ndarray, "4 3"]:
        """Unit vectors to them, one after the other around it, shape (4, 3)."""
        (x0, x1), (y0, y1) = self.x, self.y
        return _unit(np.array([[x0, y0, 1], [x1, y0, 1], [x1, y1, 1], [x0, y1, 1]]) @ self.frame)

    def cap(self) -> tuple[Vector, float]:
        """Centre and angular radius, below a quarter of a turn, of a cap that holds it."""
        corners = self.corners()
        middles = np.stack([_unit(corners.sum(axis=0)), self.frame[2]])
        lowest = (middles @ corners.T).min(axis=1)
        best = int(np.argmax(lowest))
        return middles[best], float(np.arccos(np.clip(lowest[best], 0.0, 1.0)))

    def spread(self, along: Float[ndarray, " n"], across: Float[ndarray, " n"]) -> tuple[Float[ndarray, "n 3"], float]:
        """Directions of equal solid angle, shape (n, 3), and the solid angle of all of it.

        Args:
            along: shares of the solid angle, 0 .. 1, that lie before each direction along e1.
            across: the same across, along e2.
        """
        from scipy.integrate import cumulative_simpson  # a heavy import that few tasks need

        t = np.linspace(np.arcsinh(self.x[0]), np.arcsinh(self.x[1]), STRIPS + 1)
        low, high = (_h(np.sinh(t), y) for y in self.y)
        sums = cumulative_simpson((high - low) / np.cosh(t), x=t, initial=0.0)
        x = np.sinh(np.interp(along * sums[-1], sums, t))
        low, high = (_h(x, y) for y in self.y)
        h = low + across * (high - low)
        y = h * np.sqrt((1 + x * x) / np.maximum((1 - h) * (1 + h), 1e-300))
        return _unit(np.stack([x, y, np.ones_like(x)], axis=1) @ self.frame), float(sums[-1])


def edge_normals(corners_m: Float[ndarray, "4 3"]) -> Float[ndarray, "4 3"]:
    """Unit normals, inward, of the planes through the optical centre and each side; corners go around, shape (4, 3)."""
    normals = _unit(np.cross(corners_m, np.roll(corners_m, -1, axis=0)))
    inward = np.sign(normals[0] @ corners_m[2])
    return normals * inward


def seen_rectangle(normals: Float[ndarray, "4 3"]) -> SeenRectangle:
    """The rectangle between four such planes; its scale, which has no effect, is left open."""
    corners = _unit(np.cross(np.roll(normals, 1, axis=0), normals))
    corners *= np.sign(corners[0] @ normals[1])  # corner 0 lies between sides 3 and 0, and inside of side 1
    e1, e2 = _unit(np.cross(normals[0], normals[2])), _unit(np.cross(normals[1], normals[3]))
    n = _unit(np.cross(e1, e2))
    frame = np.stack([e1, e2, n * np.sign(n @ corners.sum(axis=0))])
    seen = corners @ frame.T
    x, y = np.sort(seen[[0, 2], 0] / seen[[0, 2], 2]), np.sort(seen[[0, 2], 1] / seen[[0, 2], 2])
    return SeenRectangle(frame, (float(x[0]), float(x[1])), (float(y[0]), float(y[1])))


def _h(x: Float[ndarray, " n"], y: float) -> Float[ndarray, " n"]:
    return y / np.sqrt(1 + x * x + y * y)


def _unit(v: Float[ndarray, "... 3"]) -> Float[ndarray, "... 3"]:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)

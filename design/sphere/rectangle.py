"""A rectangle on a plane as the optical centre sees it: a spherical polygon of four arcs of great circles.

In a frame with e1 and e2 along its sides and n towards its plane, the points of the plane at unit distance are
(x, y, 1). A strip of the rectangle at x = sinh t subtends the solid angle

    dO = (h(y1) - h(y0)) / cosh t dt,   h(y) = y / sqrt(1 + x^2 + y^2)

which stays accurate for distant and for narrow rectangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

STRIPS = 2048  # of the sum of the solid angle: an even number


@dataclass(frozen=True, slots=True)
class SeenRectangle:
    """A rectangle: rows e1, e2, n of its frame, and its bounds along e1 and e2 at unit distance of the plane."""

    frame: Float[ndarray, "3 3"]
    x: tuple[float, float]
    y: tuple[float, float]

    def spread(self, along: Float[ndarray, " n"], across: Float[ndarray, " n"]) -> tuple[Float[ndarray, "n 3"], float]:
        """Return a direction for each pair of area-preserving coordinates 0 .. 1, and the solid angle of the rectangle.

        `along` is the share of the solid angle below a direction along e1, `across` the share of its strip along e2.
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
    """Return the inward unit normals of the planes through the optical centre and each side of a rectangle."""
    normals = _unit(np.cross(corners_m, np.roll(corners_m, -1, axis=0)))
    inward = np.sign(normals[0] @ corners_m[2])
    return normals * inward


def seen_rectangle(normals: Float[ndarray, "4 3"]) -> SeenRectangle:
    """Return the rectangle between the planes of `edge_normals`, at unit distance."""
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

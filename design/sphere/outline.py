"""The outline of what a task cares about, and how far from an axis it begins and ends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.concurrency.blocked_product import product
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.sphere.corners import LOOK_RAD, around, edge_corners
from scanwright.design.sphere.painting import MAP
from scanwright.design.sphere.regions import Field, frames_about

AROUND = 3600  # points of each edge: what an arc reaches further between two of them is below 4e-7 rad
PIECE = 1024  # points that axes are compared with at a time
BETWEEN = 9  # points of each edge of a cell of a map


def reach_about(field: Field, axes: Float[ndarray, "axes 3"]) -> Float[ndarray, "axes 2"]:
    """Lowest and highest polar angle about unit axes (n, 3) at which there is weight, shape (n, 2).

    The way from an axis to a region ends at its outline, but for a region that the axis itself lies in.
    """
    arcs, points = _outline(field)
    if not arcs and not len(points):  # all of the sphere
        return np.tile([0.0, np.pi], (len(axes), 1))
    cosines = [arc.cosines(axes) for arc in arcs]
    if len(points):
        parts = in_chunks(lambda chunk: _cosines(points, axes[chunk]), len(axes), smallest=16)
        cosines.append(np.concatenate(parts))
    both = np.stack(cosines)
    reach = np.arccos(np.clip(np.stack([both[:, :, 0].max(axis=0), both[:, :, 1].min(axis=0)], axis=1), -1, 1))
    reach[field.weight_at(axes) > 0, 0] = 0.0
    reach[field.weight_at(-axes) > 0, 1] = np.pi
    return reach


def _cosines(points: Float[ndarray, "n 3"], axes: Float[ndarray, "axes 3"]) -> Float[ndarray, "axes 2"]:
    """Cosines from axes to the nearest point and to the farthest, shape (axes, 2)."""
    pieces = [points[i : i + PIECE].T for i in range(0, len(points), PIECE)]  # the cache holds a piece
    cosine = np.stack([[c.max(axis=1), c.min(axis=1)] for c in (product(axes, piece) for piece in pieces)])
    return np.stack([cosine[:, 0].max(axis=0), cosine[:, 1].min(axis=0)], axis=1)


@dataclass(frozen=True, slots=True)
class _Arcs:
    """Where the weight begins along a circle `x . m = c`: azimuths about m, in order, in a frame (e1, e2, m)."""

    frame: Float[ndarray, "3 3"]
    offset: float
    azimuth_rad: Float[ndarray, " n"]

    def sides(self) -> Float[ndarray, "both 3"]:
        """Return unit vectors close to the circle, all of those inside it before all of those outside, (2 n, 3)."""
        e1, e2, normal = self.frame
        turn = self.azimuth_rad[:, None]
        out = np.cos(turn) * e1 + np.sin(turn) * e2
        along = (np.arccos(np.clip(self.offset, -1, 1)) + np.array([-LOOK_RAD, LOOK_RAD]))[:, None, None]
        return (np.cos(along) * normal + np.sin(along) * out).reshape(-1, 3)

    @property
    def _radius(self) -> float:
        return float(np.sqrt(max(0.0, 1 - self.offset**2)))

    def cosines(self, axes: Float[ndarray, "axes 3"]) -> Float[ndarray, "axes 2"]:
        """As `_cosines`: the nearest point is next in azimuth to the axis, the farthest to the other side."""
        x, y, along = (axes @ self.frame.T).T
        turn = np.arctan2(y, x)
        out = [self._next(turn), -self._next(turn + np.pi)]
        return (self.offset * along + self._radius * np.hypot(x, y) * np.stack(out)).T

    def _next(self, azimuth_rad: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """Cosine of the way around to the nearest azimuth of the arcs."""
        behind = np.searchsorted(self.azimuth_rad, azimuth_rad % (2 * np.pi)) % len(self.azimuth_rad)
        return np.asarray(np.cos(self.azimuth_rad[[behind - 1, behind]] - azimuth_rad).max(axis=0))


@lru_cache(maxsize=64)
def _outline(field: Field) -> tuple[tuple[_Arcs, ...], Float[ndarray, "n 3"]]:
    """Where the weight begins: arcs of edges, and points of cells of maps and all corners, shape (n, 3)."""
    arcs = []
    for plane in field.planes:
        full = _Arcs(frames_about(plane[None, :3])[0], float(plane[3]), 2 * np.pi * np.arange(AROUND) / AROUND)
        begins = _on_both_sides(field.weight_at(full.sides()).reshape(2, -1).T)
        if begins.any():
            arcs.append(replace(full, azimuth_rad=full.azimuth_rad[begins]))
    cells = [
        _on_cells(layers.tables[int(row[1])], row)
        for layers in (field.weight, field.mask)
        for row in layers.rows[layers.rows[:, 0] == MAP]
    ]
    points = np.concatenate([np.empty((0, 3)), *cells])
    corners = edge_corners(field)
    started = corners.points[_on_both_sides(corners.weights)]
    return tuple(arcs), np.concatenate([points[_begins(field, points)], started])


def _begins(field: Field, points: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Whether there is weight on one side of points and none on another."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    return _on_both_sides(field.weight_at(around(points).reshape(-1, 3)).reshape(len(points), -1))


def _on_both_sides(weights: Float[ndarray, "n looks"]) -> Bool[ndarray, " n"]:
    """Whether some of the weights around each point are above 0, and others not."""
    return np.asarray((weights > 0).any(axis=1) & ~(weights > 0).all(axis=1))


def _on_cells(table: Float[ndarray, "rows columns"], row: Float[ndarray, " 14"]) -> Float[ndarray, "n 3"]:
    """Points along those edges of a map's cells at which it begins to hold something."""
    height, width = int(row[2]), int(row[3])
    holds = table[:height, :width] > 0
    along = np.linspace(0, 1, BETWEEN)
    r, c = np.nonzero(holds[:-1] != holds[1:])  # across the parallel below a cell
    theta = [np.repeat(np.pi * (r + 1) / height, BETWEEN)]
    phi = [(2 * np.pi * (c[:, None] + along) / width).ravel()]
    r, c = np.nonzero(holds != np.roll(holds, 1, axis=1))  # across the meridian in front of a cell
    theta.append((np.pi * (r[:, None] + along) / height).ravel())
    phi.append(np.repeat(2 * np.pi * c / width, BETWEEN))
    t, p = np.concatenate(theta), np.concatenate(phi)
    return np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)

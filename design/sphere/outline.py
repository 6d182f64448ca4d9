"""The outline of the weighted region, and its lowest and highest polar angle about an axis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.concurrency.blocked_product import product
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.sphere.corners import PROBE_RAD, edge_corners, probes_around
from scanwright.design.sphere.painting import MAP
from scanwright.design.sphere.regions import Field, frames_about

AROUND = 3600  # points of each edge circle: the error of a polar angle is below 4e-7 rad
PIECE = 1024  # points of one matrix product
BETWEEN = 9  # points of each edge of a map cell
MOST_INSIDE = 1200  # directions of `just_inside` on arcs, and as many on map cells


def reach_about(field: Field, axes: Float[ndarray, "axes 3"]) -> Float[ndarray, "axes 2"]:
    """Return the lowest and highest polar angle [rad] of the weighted region about each axis.

    Both lie on the outline, unless the region contains the axis or its opposite.
    """
    arcs, points = _outline(field)
    if not arcs and not len(points):  # the entire sphere
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


@lru_cache(maxsize=64)
def just_inside(field: Field) -> Float[ndarray, "n 3"]:
    """Return weighted directions next to the outline of the region: a blind spot enters the region there."""
    arcs, points = _outline(field)
    sides = np.concatenate([np.empty((0, 3)), *(arc.sides() for arc in arcs)])
    sides = _thinned(sides[field.weight_at(sides) > 0])
    probes = probes_around(_thinned(points))
    weighted = field.weight_at(probes.reshape(-1, 3)).reshape(probes.shape[:2]) > 0
    which = weighted.any(axis=1)
    return np.concatenate([sides, probes[which, weighted[which].argmax(axis=1)]])


def _thinned(points: Float[ndarray, "n 3"]) -> Float[ndarray, "m 3"]:
    return points[:: len(points) // MOST_INSIDE + 1]


def _cosines(points: Float[ndarray, "n 3"], axes: Float[ndarray, "axes 3"]) -> Float[ndarray, "axes 2"]:
    """Return the cosines of the angles from each axis to the nearest and to the farthest point."""
    pieces = [points[i : i + PIECE].T for i in range(0, len(points), PIECE)]  # a piece fits in the cache
    cosine = np.stack([[c.max(axis=1), c.min(axis=1)] for c in (product(axes, piece) for piece in pieces)])
    return np.stack([cosine[:, 0].max(axis=0), cosine[:, 1].min(axis=0)], axis=1)


@dataclass(frozen=True, slots=True)
class _Arcs:
    """The points of an edge circle `x . m = c` (offset) at which weight begins: increasing azimuths in (e1, e2, m)."""

    frame: Float[ndarray, "3 3"]
    offset: float
    azimuth_rad: Float[ndarray, " n"]

    def sides(self) -> Float[ndarray, "both 3"]:
        """Return unit vectors close to the circle, first those inside it, then those outside, shape (2 n, 3)."""
        e1, e2, normal = self.frame
        turn = self.azimuth_rad[:, None]
        out = np.cos(turn) * e1 + np.sin(turn) * e2
        along = (np.arccos(np.clip(self.offset, -1, 1)) + np.array([-PROBE_RAD, PROBE_RAD]))[:, None, None]
        return (np.cos(along) * normal + np.sin(along) * out).reshape(-1, 3)

    def cosines(self, axes: Float[ndarray, "axes 3"]) -> Float[ndarray, "axes 2"]:
        """Return the cosines of the angles from each axis to the nearest and to the farthest point."""
        x, y, along = (axes @ self.frame.T).T
        turn = np.arctan2(y, x)
        out = [self._nearest(turn), -self._nearest(turn + np.pi)]
        radius = float(np.sqrt(max(0.0, 1 - self.offset**2)))
        return (self.offset * along + radius * np.hypot(x, y) * np.stack(out)).T

    def _nearest(self, azimuth_rad: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """Return the cosine of the azimuth distance to the nearest point."""
        behind = np.searchsorted(self.azimuth_rad, azimuth_rad % (2 * np.pi)) % len(self.azimuth_rad)
        return np.asarray(np.cos(self.azimuth_rad[[behind - 1, behind]] - azimuth_rad).max(axis=0))


@lru_cache(maxsize=64)
def _outline(field: Field) -> tuple[tuple[_Arcs, ...], Float[ndarray, "n 3"]]:
    """Return the outline: arcs of edge circles, and points of map cells and corners."""
    arcs = []
    for plane in field.planes:
        full = _Arcs(frames_about(plane[None, :3])[0], float(plane[3]), 2 * np.pi * np.arange(AROUND) / AROUND)
        begins = _is_outline(field.weight_at(full.sides()).reshape(2, -1).T)
        if begins.any():
            arcs.append(replace(full, azimuth_rad=full.azimuth_rad[begins]))
    cells = [
        _on_cells(layers.tables[int(row[1])], row)
        for layers in (field.weight, field.mask)
        for row in layers.rows[layers.rows[:, 0] == MAP]
    ]
    points = np.concatenate([np.empty((0, 3)), *cells])
    corners = edge_corners(field)
    if len(points):
        probes = field.weight_at(probes_around(points).reshape(-1, 3)).reshape(len(points), -1)
        points = points[_is_outline(probes)]
    return tuple(arcs), np.concatenate([points, corners.points[_is_outline(corners.weights)]])


def _is_outline(weights: Float[ndarray, "n probes"]) -> Bool[ndarray, " n"]:
    """Return whether some but not all of the weights around each point are above 0."""
    return np.asarray((weights > 0).any(axis=1) & ~(weights > 0).all(axis=1))


def _on_cells(table: Float[ndarray, "rows columns"], row: Float[ndarray, " 14"]) -> Float[ndarray, "n 3"]:
    """Return points along those edges of map cells that separate cells of weight 0 from others."""
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

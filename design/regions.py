"""Weights and masks on the sphere: painted in order, the last region that contains a direction wins.

Every edge of a band, a cone or a map cell lies in a plane `x . m = c`. So along a circle about any axis the weight
is piecewise constant between the circle's crossings with those planes, and its integral over the circle is a
finite sum: exact, region edges included.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit

from design.frames import Array
from design.parallel import in_chunks
from design.task import All, Band, Cone, LoadedTask, Map

ALL, BAND, CONE, MAP = 0.0, 1.0, 2.0, 3.0
EDGE = 1e-12  # edges are inclusive: a direction this close to one [rad, or cosine] lies on it


@dataclass(frozen=True, slots=True)
class Layers:
    """Painted regions as numbers.

    `rows`: (kind, six parameters, value) of each region, in painting order, shape (regions, 8).
    `planes`: (m, c) of each edge, shape (edges, 4). `tables`: the maps, padded to one shape, (maps, rows, columns).
    """

    rows: Array
    planes: Array
    tables: Array


@dataclass(frozen=True, slots=True)
class Field:
    """Weight and mask of a task."""

    weight: Layers
    mask: Layers
    background: float

    def weight_at(self, directions: Array) -> Array:
        """Weight of unit vectors (n, 3); masked directions weigh 0. Shape (n,)."""
        painted = _paint(self.weight, directions, self.background)
        return np.where(self.masked_at(directions), 0.0, painted)

    def masked_at(self, directions: Array) -> Array:
        """Whether unit vectors (n, 3) are hidden by the robot, shape (n,)."""
        return _paint(self.mask, directions, 0.0) > 0

    @property
    def edges(self) -> int:
        """Number of edge planes: what a circle integral costs."""
        return len(self.weight.planes) + len(self.mask.planes)

    def on_circles(self, axis: Array, polar_rad: Array) -> tuple[Array, Array]:
        """Mean weight and unmasked share along circles at polar angles about `axis`, both of shape (n,); exact."""
        means = self._circles(_frame_about(axis))
        parts = in_chunks(lambda chunk: means(polar_rad[chunk]), len(polar_rad))
        return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])

    def on_circles_about(self, axes: Array, polar_rad: Array) -> Array:
        """Mean weight on the same circles about many axes (n, 3), shape (n, len(polar_rad)); exact."""
        parts = in_chunks(
            lambda chunk: np.stack([self._circles(_frame_about(axis))(polar_rad)[0] for axis in axes[chunk]]),
            len(axes),
            smallest=1,
        )
        return np.concatenate(parts)

    def _circles(self, frame: Array) -> Callable[[Array], tuple[Array, Array]]:
        weight, mask = self.weight, self.mask
        planes = np.concatenate([weight.planes, mask.planes])
        return lambda polar: _circle_means(
            frame, polar, planes, weight.rows, weight.tables, mask.rows, mask.tables, self.background
        )


def field_of(loaded: LoadedTask) -> Field:
    """The weights and masks of a task."""
    maps = list(loaded.maps)
    weight = _layers(loaded.task.weight, maps)
    mask = _layers(loaded.task.mask, maps)
    return Field(weight, mask, loaded.task.density.background)


def _layers(regions: Sequence[All | Band | Cone | Map], maps: list[Array]) -> Layers:
    """Turn regions into numbers; takes as many tables off the front of `maps` as there are map regions."""
    rows: list[list[float]] = []
    planes = [np.empty((0, 4))]
    tables: list[Array] = []
    for region in regions:
        if isinstance(region, All):
            rows.append([ALL, 0, 0, 0, 0, 0, 0, region.value])
        elif isinstance(region, Band):
            theta, phi = np.radians(region.theta_deg), np.radians(region.phi_deg)
            rows.append([BAND, *theta, phi[0], phi[1] - phi[0], 0, 0, region.value])
            planes.append(_edges_of_band(theta, phi))
        elif isinstance(region, Cone):
            axis = np.array(region.axis) / np.linalg.norm(region.axis)
            half = np.cos(np.radians(region.half_angle_deg))
            rows.append([CONE, *axis, half, 0, 0, region.value])
            planes.append(np.array([[*axis, half]]))
        else:
            table = maps.pop(0)
            rows.append([MAP, len(tables), *table.shape, 0, 0, 0, region.value])
            tables.append(table)
            planes.append(_edges_of_map(*table.shape))
    return Layers(np.array(rows, dtype=float).reshape(-1, 8), np.concatenate(planes), _stack(tables))


def _edges_of_band(theta: Array, phi: Array) -> Array:
    inner = [t for t in theta if 0 < t < np.pi]
    edges = [[0.0, 0.0, 1.0, np.cos(t)] for t in inner]
    if phi[1] - phi[0] < 2 * np.pi:
        edges += [[-np.sin(p), np.cos(p), 0.0, 0.0] for p in phi]
    return np.array(edges).reshape(-1, 4)


def _edges_of_map(rows: int, columns: int) -> Array:
    theta = np.pi * np.arange(1, rows) / rows
    phi = 2 * np.pi * np.arange(columns) / columns
    phi = phi[: columns // 2] if columns % 2 == 0 else phi  # a meridian plane serves phi and phi + 180 deg
    across = np.stack([0 * theta, 0 * theta, 1 + 0 * theta, np.cos(theta)], axis=1)
    along = np.stack([-np.sin(phi), np.cos(phi), 0 * phi, 0 * phi], axis=1)
    return np.concatenate([across, along])


def _frame_about(axis: Array) -> Array:
    """Rows e1, e2, axis: right-handed, orthonormal."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    e1 = np.cross(axis, helper)
    e1 /= np.linalg.norm(e1)
    return np.stack([e1, np.cross(axis, e1), axis])


def _stack(tables: list[Array]) -> Array:
    if not tables:
        return np.zeros((1, 1, 1))
    shape = np.max([t.shape for t in tables], axis=0)
    stacked = np.zeros((len(tables), *shape))
    for i, t in enumerate(tables):
        stacked[i, : t.shape[0], : t.shape[1]] = t
    return stacked


def _paint(layers: Layers, directions: Array, background: float) -> Array:
    return _values(np.ascontiguousarray(directions, dtype=float), layers.rows, layers.tables, background)


@njit(cache=True, nogil=True)
def _value(x: float, y: float, z: float, rows: Array, tables: Array, background: float) -> float:
    """Value of the last painted region that contains the direction."""
    for i in range(rows.shape[0] - 1, -1, -1):
        row = rows[i]
        kind = row[0]
        if kind == ALL:
            return row[7]
        if kind == CONE:
            if x * row[1] + y * row[2] + z * row[3] >= row[4] - EDGE:
                return row[7]
            continue
        theta = np.arctan2(np.hypot(x, y), z)
        phi = np.arctan2(y, x)
        if kind == BAND:
            if row[1] - EDGE <= theta <= row[2] + EDGE:
                beyond = (phi - row[3] + EDGE) % (2 * np.pi)
                if beyond <= row[4] + 2 * EDGE:
                    return row[7]
            continue
        height, width = int(row[2]), int(row[3])
        r = min(int(theta / np.pi * height), height - 1)
        c = min(int((phi % (2 * np.pi)) / (2 * np.pi) * width), width - 1)
        return row[7] * tables[int(row[1]), r, c]
    return background


@njit(cache=True, nogil=True)
def _values(directions: Array, rows: Array, tables: Array, background: float) -> Array:
    out = np.empty(directions.shape[0])
    for i in range(directions.shape[0]):
        out[i] = _value(directions[i, 0], directions[i, 1], directions[i, 2], rows, tables, background)
    return out


@njit(cache=True, nogil=True)
def _circle_means(
    frame: Array,
    polar: Array,
    planes: Array,
    weight_rows: Array,
    weight_tables: Array,
    mask_rows: Array,
    mask_tables: Array,
    background: float,
) -> tuple[Array, Array]:
    """Mean weight (0 where masked) and unmasked share on each circle, from the crossings with all edge planes."""
    weights, shares = np.empty(len(polar)), np.empty(len(polar))
    cuts = np.empty(2 * len(planes) + 1)
    for i in range(len(polar)):
        st, ct = np.sin(polar[i]), np.cos(polar[i])
        n = 0
        for m in planes:
            a = st * (m[0] * frame[0, 0] + m[1] * frame[0, 1] + m[2] * frame[0, 2])
            b = st * (m[0] * frame[1, 0] + m[1] * frame[1, 1] + m[2] * frame[1, 2])
            c = m[3] - ct * (m[0] * frame[2, 0] + m[1] * frame[2, 1] + m[2] * frame[2, 2])
            r = np.hypot(a, b)
            if r > abs(c):
                middle, half = np.arctan2(b, a), np.arccos(c / r)
                cuts[n] = (middle - half) % (2 * np.pi)
                cuts[n + 1] = (middle + half) % (2 * np.pi)
                n += 2
        if n == 0:
            cuts[0] = 0.0
            n = 1
        ordered = np.sort(cuts[:n])
        weight, share = 0.0, 0.0
        for j in range(n):
            after = ordered[j + 1] if j + 1 < n else ordered[0] + 2 * np.pi
            arc = after - ordered[j]
            if arc <= 0.0:
                continue
            p = 0.5 * (ordered[j] + after)
            u, v = st * np.cos(p), st * np.sin(p)
            x = u * frame[0, 0] + v * frame[1, 0] + ct * frame[2, 0]
            y = u * frame[0, 1] + v * frame[1, 1] + ct * frame[2, 1]
            z = u * frame[0, 2] + v * frame[1, 2] + ct * frame[2, 2]
            if _value(x, y, z, mask_rows, mask_tables, 0.0) > 0.0:
                continue
            share += arc
            weight += arc * _value(x, y, z, weight_rows, weight_tables, background)
        weights[i] = weight / (2 * np.pi)
        shares[i] = share / (2 * np.pi)
    return weights, shares

"""The regions of a task, evaluated one by one, and directions drawn in each, for `design.objective.counted`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Array, Mask
from scanwright.design.task.shapes import AllRegion, BandRegion, BoxRegion, ConeRegion, PlaneRegion
from scanwright.design.task.task import LoadedTask

ROUNDING = 1e-12
BY_WEIGHT = 0.75  # share of cells that are drawn by weight; the others by area
ON_EDGE = ON_EDGE_DEG = ON_EDGE_M = 1e-9  # tolerance of inclusive edges, on which nodes of the paper's grid can lie


@dataclass(frozen=True, slots=True)
class Nodes:
    """Nodes of the paper's grid with a weight: directions (n, 3), weights (n,) and required counts (n,)."""

    directions: Array
    value: Array
    required: Array


@dataclass(frozen=True, slots=True)
class Layer:
    """One region of a task."""

    region: object  # its shape; None for the surfaces of a scene
    table: Array | None  # values of its cells, shape (rows, columns); None if it has no cells
    value: float  # of the region; entries of the table are multiplied by it
    required: float | Array  # required count, a number or a table like `table`
    chances: Array | None = None  # probability of drawing each cell of the table, shape (rows, columns)

    def holds(self, d: Array) -> Mask:
        """Return whether directions lie in the region, shape (n,)."""
        region = self.region
        if isinstance(region, ConeRegion):
            axis = np.array(region.axis) / np.linalg.norm(region.axis)
            half = np.radians(min(180.0, region.half_angle_deg + ON_EDGE_DEG))
            return np.asarray(np.linalg.norm(d - axis, axis=1) <= 2 * np.sin(half / 2) + ROUNDING)
        if isinstance(region, BandRegion):
            theta = np.degrees(np.arctan2(np.hypot(d[:, 0], d[:, 1]), d[:, 2]))
            ahead = (np.degrees(np.arctan2(d[:, 1], d[:, 0])) - region.phi_deg[0] + ON_EDGE_DEG) % 360
            low, high = region.theta_deg
            inside = (low - ON_EDGE_DEG <= theta) & (theta <= high + ON_EDGE_DEG)
            pole = np.hypot(d[:, 0], d[:, 1]) < ROUNDING  # belongs to all headings
            return inside & (pole | (ahead <= region.phi_deg[1] - region.phi_deg[0] + 2 * ON_EDGE_DEG))
        if isinstance(region, PlaneRegion):
            return _On(region).holds(d)
        return np.ones(len(d), dtype=bool)

    def value_at(self, d: Array) -> Array:
        """Return its value at directions, shape (n,)."""
        return np.full(len(d), self.value) if self.table is None else self.value * _of_cells(self.table, d)

    def required_at(self, d: Array) -> Array:
        """Return the required count at directions, shape (n,)."""
        return _of_cells(self.required, d) if isinstance(self.required, np.ndarray) else np.full(len(d), self.required)

    def drawn(self, u: Array) -> tuple[Array, float]:
        """Return a direction for each point of the unit cube (n, 3), and the solid angle if they are drawn evenly."""
        region = self.region
        if isinstance(region, ConeRegion):
            half = np.radians(region.half_angle_deg)
            sine = np.sin(half / 2) * np.sqrt(u[:, 0])  # of half the angle from the axis: equal areas
            polar = 2 * np.arcsin(sine)
            d = np.stack([np.sin(polar) * np.cos(2 * np.pi * u[:, 1]), np.sin(polar) * np.sin(2 * np.pi * u[:, 1])])
            axis = np.array(region.axis) / np.linalg.norm(region.axis)
            across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
            across /= np.linalg.norm(across)
            directions = np.column_stack([*d, np.cos(polar)]) @ np.stack([across, np.cross(axis, across), axis])
            return directions, 4 * np.pi * np.sin(half / 2) ** 2
        if isinstance(region, PlaneRegion):
            return _On(region).drawn(u), float("nan")
        z, phi = (-1.0, 1.0), (0.0, 2 * np.pi)
        if isinstance(region, BandRegion):
            z = tuple(np.cos(np.radians(region.theta_deg[::-1])))
            phi = tuple(np.radians(region.phi_deg))
        if self.chances is not None:
            rows, columns = self.chances.shape
            z_edges = np.cos(np.pi * np.arange(rows + 1) / rows)
            ends = np.cumsum(self.chances)
            ends /= ends[-1]
            cell = np.searchsorted(ends, u[:, 0], side="right")
            inside = 1 - (ends[cell] - u[:, 0]) / (self.chances.ravel()[cell])
            r, c = np.divmod(cell, columns)
            z_drawn = z_edges[r + 1] + np.clip(inside, 0, 1) * (z_edges[r] - z_edges[r + 1])
            return _at(z_drawn, 2 * np.pi * (c + u[:, 1]) / columns), float("nan")
        height, width = z[1] - z[0], phi[1] - phi[0]
        return _at(z[0] + height * u[:, 0], phi[0] + width * u[:, 1]), height * width

    def chance(self, d: Array, area: float) -> Array:
        """Return the probability density of drawing each direction [1/sr]."""
        if isinstance(self.region, PlaneRegion):
            return _On(self.region).chance(d)
        if self.chances is None:
            return np.where(self.holds(d), 1 / area, 0.0)
        return _of_cells(self.chances / _cell_areas(*self.chances.shape), d)


def _cell_areas(rows: int, columns: int) -> Array:
    """Return the solid angle of a cell in each row, shape (rows, 1)."""
    edges = np.cos(np.pi * np.arange(rows + 1) / rows)
    return (edges[:-1] - edges[1:])[:, None] * 2 * np.pi / columns


def _chances(table: Array) -> Array:
    """Return the probability of drawing each cell: by weight, and partly by area, which the objective `kl` needs."""
    areas = np.where(table > 0, _cell_areas(*table.shape), 0.0)
    weights = areas * table
    total = weights.sum()
    return BY_WEIGHT * weights / total + (1 - BY_WEIGHT) * areas / areas.sum() if total > 0 else areas


def _of_cells(table: Array, d: Array) -> Array:
    """Return the entries of a table of cells at directions, shape (n,)."""
    rows, columns = table.shape
    across = np.hypot(d[:, 0], d[:, 1])
    phi = np.where(across < ROUNDING, 0.0, np.arctan2(d[:, 1], d[:, 0]))  # a pole has no heading
    r = np.minimum((np.arctan2(across, d[:, 2]) / np.pi * rows + ON_EDGE).astype(int), rows - 1)
    c = (phi / (2 * np.pi) % 1 * columns + ON_EDGE).astype(int) % columns
    return np.asarray(table[r, c])


class _On:
    """A rectangle on a plane, evaluated by the intersections of rays with the plane.

    Points are drawn by two angles: in the plane of its normal and its first side, and perpendicular to that.
    """

    def __init__(self, region: PlaneRegion) -> None:
        a, b, _, d = (np.array(corner) for corner in region.corners_m())
        self.origin, self.along, self.across = a, b - a, d - a
        self.e1, self.e2 = self.along / np.linalg.norm(self.along), self.across / np.linalg.norm(self.across)
        normal = np.cross(self.e1, self.e2)
        self.normal = normal * np.sign(normal @ a)
        self.away = float(self.normal @ a)
        self.x = self.e1 @ a, self.e1 @ b
        self.y = self.e2 @ a, self.e2 @ d

    def holds(self, d: Array) -> Mask:
        facing = d @ self.normal
        met = d * (self.away / np.where(facing > 0, facing, np.nan))[:, None]
        x, y = met @ self.e1, met @ self.e2
        x_m, y_m = np.add(self.x, (-ON_EDGE_M, ON_EDGE_M)), np.add(self.y, (-ON_EDGE_M, ON_EDGE_M))
        return (facing > 0) & (x_m[0] <= x) & (x <= x_m[1]) & (y_m[0] <= y) & (y <= y_m[1])

    def drawn(self, u: Array) -> Array:
        p = np.arctan2(self.x, self.away)
        turn = p[0] + (p[1] - p[0]) * u[:, 0]
        q = self._across(turn)
        lift = q[0] + (q[1] - q[0]) * u[:, 1]
        ahead = np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn)
        return np.outer(ahead[0], self.normal) + np.outer(ahead[1], self.e1) + np.outer(np.sin(lift), self.e2)

    def chance(self, d: Array) -> Array:
        p = np.arctan2(self.x, self.away)
        q = self._across(np.arctan2(d @ self.e1, d @ self.normal))
        lift = np.arcsin(np.clip(d @ self.e2, -1, 1))
        return np.where(self.holds(d), 1 / ((p[1] - p[0]) * (q[1] - q[0]) * np.cos(lift)), 0.0)

    def _across(self, turn: Array) -> tuple[Array, Array]:
        away = self.away / np.cos(turn)
        return np.arctan2(self.y[0], away), np.arctan2(self.y[1], away)


def _at(z: Array, phi: Array) -> Array:
    r = np.sqrt(np.maximum((1 - z) * (1 + z), 0))
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z])


def layers_of(loaded: LoadedTask) -> tuple[list[Layer], list[Layer]]:
    """Return the weights in painting order, the background first, and the masks."""
    task, maps = loaded.task, list(loaded.maps)
    required_everywhere = task.density.required or 0.0
    every = AllRegion(shape="all")

    def layer(region: object, value: float, required: float) -> Layer:
        mapped = not isinstance(region, AllRegion | BandRegion | ConeRegion | BoxRegion | PlaneRegion)
        table = maps.pop(0) if mapped else None
        return Layer(region, table, value, required, None if table is None else _chances(table))

    weights = [Layer(every, None, task.density.background, required_everywhere)]
    weights += [layer(r, r.value, required_everywhere if r.required is None else r.required) for r in task.weight]
    masks = [layer(r, 1.0, 0.0) for r in task.mask]
    surface = loaded.surface
    if surface is None:
        return weights, masks
    shape, d = surface.range_m.shape, surface.directions.reshape(-1, 3)
    painted, required, area = np.zeros(len(d)), np.zeros(len(d)), surface.area_per_sr().ravel()
    points = surface.points_m.reshape(-1, 3)
    for one in weights:
        if isinstance(one.region, BoxRegion):
            here = ((points >= one.region.min_m) & (points <= one.region.max_m)).all(axis=1)
            painted = np.where(here, one.value * area, painted)
        else:
            here = one.holds(d)
            painted = np.where(here, one.value_at(d), painted)
        required = np.where(here, one.required, required)
    lidar = loaded.lidar
    in_range = (surface.range_m >= lidar.range_min_mm / 1000) & (surface.range_m <= lidar.practical_range_m)
    hidden = np.zeros(len(d), dtype=bool)
    for one in masks:
        hidden |= one.holds(d) & (one.value_at(d) > 0)
    table = np.where(in_range.ravel() & ~hidden, painted, 0.0).reshape(shape)
    return [Layer(None, table, 1.0, required.reshape(shape), _chances(table))], []


def value_and_required(layers: tuple[list[Layer], list[Layer]], d: Array) -> tuple[Array, Array]:
    """Return the weight at directions, 0 if masked, and the required count, shape (n,) each."""
    value, required = np.zeros(len(d)), np.zeros(len(d))
    for one in layers[0]:
        here = one.holds(d)
        value, required = np.where(here, one.value_at(d), value), np.where(here, one.required_at(d), required)
    for one in layers[1]:
        value = np.where(one.holds(d) & (one.value_at(d) > 0), 0.0, value)
    return value, required


def nodes_in(layers: tuple[list[Layer], list[Layer]], step_deg: float) -> Nodes:
    """Return the nodes of the paper's grid with a weight; the poles are in it once for every phi."""
    theta = np.pi * np.arange(round(180 / step_deg) + 1) / round(180 / step_deg)
    phi = 2 * np.pi * np.arange(round(360 / step_deg)) / round(360 / step_deg)
    t, p = np.repeat(theta, len(phi)), np.tile(phi, len(theta))
    d = np.column_stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)])
    value, required = value_and_required(layers, d)
    return Nodes(d[value > 0], value[value > 0], required[value > 0])


def drawn_in(layers: tuple[list[Layer], list[Layer]]) -> list[Layer]:
    """Return the regions in which directions are drawn: those with a weight."""
    return [one for one in layers[0] if one.value > 0 and (one.table is None or one.table.any())]

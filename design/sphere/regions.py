"""Weights and masks on the sphere. The last region that contains a direction determines its weight; masks unite.

Every edge of a band, a cone, a rectangle on a plane or a map cell lies in a plane `x . m = c`. So the weight along a
circle about any axis is constant between its crossings with those planes, and the integral over the circle is a finite
sum: exact, region edges included.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from scanwright.design.arrays import Array, Vector
from scanwright.design.concurrency.parallel import in_chunks
from scanwright.design.scene.surface import Surface
from scanwright.design.sphere.painting import (
    ALL,
    BAND,
    COLUMNS,
    CONE,
    MAP,
    POLYGON,
    VALUE,
    circle_means,
    masked_at,
    summed_over,
    values_at,
)
from scanwright.design.sphere.rectangle import edge_normals
from scanwright.design.task.shapes import (
    AllRegion,
    BandRegion,
    BoxRegion,
    ConeRegion,
    MapRegion,
    MaskRegion,
    PlaneRegion,
    Region,
)
from scanwright.design.task.task import LoadedTask

FEW_CIRCLES = 1024  # fewer are faster in one thread
EVERYWHERE = np.array([[-np.inf, np.inf]])
_NEXT, _LAST = [1, 2, 0], [2, 0, 1]


@dataclass(frozen=True, slots=True)
class Layers:
    """Painted regions as numbers."""

    rows: Float[ndarray, "regions 14"]  # kind, twelve parameters and value of each region, in painting order
    planes: Float[ndarray, "edges 4"]  # (m, c) of each edge of a band, a cone or a rectangle
    map_planes: Float[ndarray, "cell_edges 4"]  # the same for map cells
    tables: Float[ndarray, "maps rows columns"]  # the maps, padded to one shape


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Weight and mask of a task; compared by identity, so that it can be the key of a cache."""

    weight: Layers
    mask: Layers
    background: float

    def weight_at(self, directions: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Return the weight of unit vectors, 0 for masked ones."""
        painted = _paint(self.weight, directions, self.background)
        return np.where(self.masked_at(directions), 0.0, painted)

    def masked_at(self, directions: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
        """Return whether a mask hides each unit vector."""
        return _masked(self.mask, directions)

    @property
    def planes(self) -> Float[ndarray, "edges 4"]:
        """Planes of the edges of bands, cones and rectangles, masks included."""
        return np.concatenate([self.weight.planes, self.mask.planes])

    @property
    def map_planes(self) -> Float[ndarray, "cell_edges 4"]:
        """Planes of the edges of map cells, masks included."""
        return np.concatenate([self.weight.map_planes, self.mask.map_planes])

    @property
    def edges(self) -> int:
        """Number of edge planes, to which the time of a circle integral is proportional."""
        return sum(len(e.planes) + len(e.map_planes) for e in (self.weight, self.mask))

    @property
    def patches(self) -> Float[ndarray, "patches 14"]:
        """Rows of the regions with a value above 0, and of the background: together they contain all weight."""
        rows = self.weight.rows[self.weight.rows[:, VALUE] > 0]
        return rows if self.background == 0 else np.vstack([rows, _row(ALL, [], self.background)])

    def summed_at(self, directions: Float[ndarray, "n 3"], of_patches: Float[ndarray, " patches"]) -> Array:
        """Return, for each direction, the sum of `of_patches` over the `patches` that contain it, shape (n,)."""
        return summed_over(np.ascontiguousarray(directions, dtype=float), self.patches, self.weight.tables, of_patches)

    def on_circles(
        self, axis: Vector, polar_rad: Float[ndarray, " n"]
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        """Return the exact mean weight and unmasked share of circles at polar angles about `axis`."""
        numbers = _numbers(self)
        frame = frames_about(axis[None])
        parts = in_chunks(
            lambda chunk: circle_means(frame, polar_rad[chunk], EVERYWHERE, *numbers), len(polar_rad), FEW_CIRCLES
        )
        return np.concatenate([p[0][0] for p in parts]), np.concatenate([p[1][0] for p in parts])

    def on_circles_about(
        self, axes: Float[ndarray, "axes 3"], polar_rad: Float[ndarray, " n"], reach_rad: Float[ndarray, "axes 2"]
    ) -> Float[ndarray, "axes n"]:
        """Return the exact mean weight of circles about many axes, 0 outside the polar angles `reach_rad`."""
        numbers = _numbers(self)
        frames = frames_about(axes)
        parts = in_chunks(
            lambda chunk: circle_means(frames[chunk], polar_rad, reach_rad[chunk], *numbers)[0], len(axes), smallest=8
        )
        return np.concatenate(parts)


@lru_cache(maxsize=64)
def _numbers(field: Field) -> tuple[Array, Array, Array, Array, Array, float]:
    """Return the arguments of `circle_means` for a field."""
    weight, mask = field.weight, field.mask
    planes = np.unique(np.concatenate([field.planes, field.map_planes]), axis=0)  # weight and mask can share edges
    return planes, weight.rows, weight.tables, mask.rows, mask.tables, field.background


def value_of(region: Region | MaskRegion) -> float:
    """Return the value of a region."""
    return region.value


def field_of(
    loaded: LoadedTask, weight_of: Callable[[Region], float] = value_of, background: float | None = None
) -> Field:
    """Return the weights and masks of a task, with other values of the regions and of the background if given.

    With a scene both are tables on its grid of rays: directions without a surface in range are masked, and surfaces in
    a box have a weight by area.
    """
    maps = list(loaded.maps)
    background = loaded.task.density.background if background is None else background
    if loaded.surface is not None:
        return _on_surface(loaded, loaded.surface, maps, weight_of, background)
    weight = _layers(loaded.task.weight, maps, weight_of)
    mask = _layers(loaded.task.mask, maps, value_of)
    return Field(weight, mask, background)


def _on_surface(
    loaded: LoadedTask,
    surface: Surface,
    maps: list[Array],
    weight_of: Callable[[Region], float],
    background: float,
) -> Field:
    shape = surface.range_m.shape
    flat = surface.directions.reshape(-1, 3)
    area = surface.area_per_sr()
    painted = np.full(shape, background)
    for region in loaded.task.weight:
        if isinstance(region, BoxRegion):
            inside = ((surface.points_m >= region.min_m) & (surface.points_m <= region.max_m)).all(axis=2)
            painted = np.where(inside, weight_of(region) * area, painted)
            continue
        one = _layers([region], maps, lambda _: 1.0)
        here = _paint(one, flat, -1.0).reshape(shape)
        painted = np.where(here >= 0, weight_of(region) * np.maximum(here, 0.0), painted)
    robot = _masked(_layers(loaded.task.mask, maps, value_of), flat).reshape(shape)
    lidar = loaded.lidar
    seen = surface.within(lidar.range_min_mm / 1000, lidar.practical_range_m)
    hidden = MapRegion(shape="map", file="")
    weight = _layers([hidden], [np.where(robot | ~seen, 0.0, painted)], value_of)
    return Field(weight, _layers([hidden], [(robot | ~seen).astype(float)], value_of), 0.0)


def _layers(regions: Sequence[Region | MaskRegion], maps: list[Array], weight_of: Callable[[Any], float]) -> Layers:
    """Return regions as numbers; remove a table from the front of `maps` for each region that has one."""
    rows: list[Array] = []
    planes, map_planes = [np.empty((0, 4))], [np.empty((0, 4))]
    tables: list[Array] = []
    for region in regions:
        value = weight_of(region)
        if isinstance(region, AllRegion):
            rows.append(_row(ALL, [], value))
        elif isinstance(region, BandRegion):
            theta, phi = np.radians(region.theta_deg), np.radians(region.phi_deg)
            middle, half = (phi[0] + phi[1]) / 2, (phi[1] - phi[0]) / 2
            around = [np.cos(middle), np.sin(middle), np.cos(half)]
            rows.append(_row(BAND, [np.cos(theta[1]), np.cos(theta[0]), *around], value))
            planes.append(_edges_of_band(theta, phi))
        elif isinstance(region, ConeRegion):
            axis = np.array(region.axis) / np.linalg.norm(region.axis)
            half_angle = np.radians(region.half_angle_deg)
            rows.append(_row(CONE, [*axis, np.cos(half_angle)], value))
            planes.append(np.array([[*axis, np.cos(half_angle)]]))
        elif isinstance(region, PlaneRegion):
            normals = edge_normals(np.array(region.corners_m()))
            rows.append(_row(POLYGON, normals.ravel().tolist(), value))
            planes.append(np.column_stack([normals, np.zeros(len(normals))]))
        else:
            table = maps.pop(0)
            rows.append(_row(MAP, [len(tables), *table.shape], value))
            tables.append(table)
            map_planes.append(_edges_of_map(table))
    return Layers(
        np.array(rows, dtype=float).reshape(-1, COLUMNS),
        np.concatenate(planes),
        np.concatenate(map_planes),
        _stack(tables),
    )


def _row(kind: float, parameters: Sequence[float], value: float) -> Float[ndarray, " 14"]:
    row = np.zeros(COLUMNS)
    row[0], row[1 : 1 + len(parameters)], row[VALUE] = kind, parameters, value
    return row


def _edges_of_band(theta: Array, phi: Array) -> Float[ndarray, "edges 4"]:
    inner = [t for t in theta if 0 < t < np.pi]
    edges = [[0.0, 0.0, 1.0, np.cos(t)] for t in inner]
    if phi[1] - phi[0] < 2 * np.pi:
        edges += [[-np.sin(p), np.cos(p), 0.0, 0.0] for p in phi]
    return np.array(edges).reshape(-1, 4)


def _edges_of_map(table: Float[ndarray, "rows columns"]) -> Float[ndarray, "edges 4"]:
    """Return the planes between rows and columns of cells with different values."""
    rows, columns = table.shape
    theta = np.pi * np.arange(1, rows)[(table[1:] != table[:-1]).any(axis=1)] / rows
    differ = (table != np.roll(table, 1, axis=1)).any(axis=0)
    if columns % 2 == 0:  # a meridian plane serves phi and phi + 180 deg
        differ = differ[: columns // 2] | differ[columns // 2 :]
    phi = 2 * np.pi * np.flatnonzero(differ) / columns
    across = np.stack([0 * theta, 0 * theta, 1 + 0 * theta, np.cos(theta)], axis=1)
    along = np.stack([-np.sin(phi), np.cos(phi), 0 * phi, 0 * phi], axis=1)
    return np.concatenate([across, along])


def frames_about(axes: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
    """Return a right-handed orthonormal frame for each axis, rows e1, e2, axis."""
    helper = np.eye(3)[np.argmin(np.abs(axes), axis=1)]
    e1 = cross(axes, helper)
    e1 /= np.linalg.norm(e1, axis=1, keepdims=True)
    return np.stack([e1, cross(axes, e1), axes], axis=1)


def cross(a: Float[ndarray, "n 3"], b: Float[ndarray, "m 3"]) -> Float[ndarray, "n 3"]:
    """Return `np.cross(a, b)`, several times as fast; m is n or 1."""
    return a[:, _NEXT] * b[:, _LAST] - a[:, _LAST] * b[:, _NEXT]


def _stack(tables: list[Array]) -> Array:
    if not tables:
        return np.zeros((1, 1, 1))
    shape = np.max([t.shape for t in tables], axis=0)
    stacked = np.zeros((len(tables), *shape))
    for i, t in enumerate(tables):
        stacked[i, : t.shape[0], : t.shape[1]] = t
    return stacked


def _paint(layers: Layers, directions: Float[ndarray, "n 3"], background: float) -> Float[ndarray, " n"]:
    return values_at(np.ascontiguousarray(directions, dtype=float), layers.rows, layers.tables, background)


def _masked(layers: Layers, directions: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    return masked_at(np.ascontiguousarray(directions, dtype=float), layers.rows, layers.tables)

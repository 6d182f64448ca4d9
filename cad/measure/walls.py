"""Cylinders in a mesh: walls of holes and bosses. Millimetres."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scanwright.cad.geometry.holes import triple
from scanwright.design.arrays import Array

ALONG = 0.02  # cosine between the normal of a wall and the axis that it runs along
SMOOTH = math.cos(math.radians(50))  # between facets of one cylinder: eight sides at least
LEAST_FACETS = 6
OFF_MM, OFF_SHARE = 0.02, 0.003  # corners from their circle
LONG = 2.5  # times the median: a facet as wide is a plane that runs into the cylinder
SECTORS = 72
SAME_MM = 0.03  # between axes, radii and ends of one cylinder
CORNER_MM = 1e-3  # between corners that are one
LEAST_RADIUS_MM = 0.4  # of a screw's hole
LEAST_PLANE = 0.005  # of the surface: least plane whose normal is an axis


@dataclass(frozen=True, slots=True)
class Wall:
    """A cylinder, or a slot with straight sides and two round ends."""

    axis: tuple[float, float, float]  # unit vector along it
    middle: tuple[float, float, float]  # point of its axis at height 0 along `axis`
    radius: float  # of the cylinder, or of a slot's ends
    low: float  # height of its lower end along `axis`
    high: float  # of its upper end
    hole: bool  # whether the material is outside
    around: float  # share of the full turn in the mesh
    # half the vector between the middles of a slot's ends; zero for a cylinder
    stretch: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def at(self, height: float) -> Array:
        """Return the point of its axis at a height."""
        return np.asarray(self.middle) + height * np.asarray(self.axis)


@dataclass(frozen=True, slots=True)
class _Flat:
    """Facets along one axis, seen along it."""

    points: Array  # (m, 3, 2)
    heights: Array  # (m, 3)
    normals: Array  # (m, 2)
    edges: NDArray[np.int64]  # (k, 2), neighbours of one smooth wall


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    """A part of a wall, seen along its axis."""

    middle: Array  # (2,)
    radius: float
    low: float
    high: float
    hole: bool
    sectors: NDArray[np.bool_]  # (SECTORS,), of the full turn
    stretch: Array  # (2,)

    def goes_on(self, below: _Piece) -> bool:
        """Return whether this piece and one that starts no higher are of one cylinder and touch."""
        apart = np.abs([*(self.middle - below.middle), *(self.stretch - below.stretch), self.radius - below.radius])
        return bool(self.hole == below.hole and apart.max() < SAME_MM and self.low <= below.high + SAME_MM)


def walls_of(triangles: Array) -> list[Wall]:
    """Return the cylinders of a mesh along x, y, z and across its larger planes; corners [mm], shape (t, 3, 3)."""
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    twice_area = np.linalg.norm(across, axis=1)
    triangles, across, twice_area = (each[twice_area > 1e-9] for each in (triangles, across, twice_area))
    normals = across / twice_area[:, None]
    corners = np.unique(np.round(triangles.reshape(-1, 3) / CORNER_MM), axis=0, return_inverse=True)[1].reshape(-1, 3)
    return [wall for axis in _axes(normals, twice_area) for wall in _walls_along(triangles, normals, corners, axis)]


def _axes(normals: Array, weights: Array) -> list[Array]:
    """Return x, y, z, and the other normals of larger planes, opposite ones once."""
    axes = list(np.eye(3))
    index = np.unique(np.round(normals, 2), axis=0, return_inverse=True)[1]
    shares = np.bincount(index.reshape(-1), weights) / weights.sum()
    for i in np.argsort(-shares)[:60]:
        if shares[i] < LEAST_PLANE:
            break
        exact = np.average(normals[index.reshape(-1) == i], axis=0, weights=weights[index.reshape(-1) == i])
        exact /= np.linalg.norm(exact)
        if all(abs(exact @ axis) < 1 - 1e-4 for axis in axes):
            axes.append(exact)
    return axes


def _walls_along(triangles: Array, normals: Array, corners: NDArray[np.int64], axis: Array) -> list[Wall]:
    chosen = np.abs(normals @ axis) < ALONG
    if chosen.sum() < LEAST_FACETS:
        return []
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    across /= np.linalg.norm(across)
    plane = np.stack([across, np.cross(axis, across)], axis=1)
    seen = triangles[chosen]
    flat = _Flat(seen @ plane, seen @ axis, normals[chosen] @ plane, _neighbours(corners[chosen], normals[chosen]))
    pieces = [piece for rows in _pieces(np.arange(chosen.sum()), flat) for piece in _fitted(rows, flat)]
    walls = []
    for piece in _joined(pieces):
        along, middle, stretch = map(triple, (axis, plane @ piece.middle, plane @ piece.stretch))
        around = float(piece.sectors.mean())
        walls.append(Wall(along, middle, piece.radius, piece.low, piece.high, piece.hole, around, stretch))
    return walls


def _neighbours(corners: NDArray[np.int64], normals: Array) -> NDArray[np.int64]:
    """Return pairs of facets that share a smooth edge."""
    edges = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    owner = np.repeat(np.arange(len(corners)), 3)
    order = np.lexsort(edges.T)
    edges, owner = edges[order], owner[order]
    same = (edges[1:] == edges[:-1]).all(axis=1)
    pairs = np.stack([owner[:-1][same], owner[1:][same]], axis=1)
    smooth = np.einsum("ij,ij->i", normals[pairs[:, 0]], normals[pairs[:, 1]]) > SMOOTH
    return np.asarray(pairs[smooth])


def _pieces(rows: NDArray[np.int64], flat: _Flat) -> Iterator[NDArray[np.int64]]:
    """Yield the connected groups of some facets."""
    place = np.full(len(flat.points), -1)
    place[rows] = np.arange(len(rows))
    pairs = place[flat.edges]
    pairs = pairs[(pairs >= 0).all(axis=1)]
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(rows), len(rows)))
    labels = connected_components(graph, directed=False)[1]
    order = np.argsort(labels, kind="stable")
    for group in np.split(order, np.flatnonzero(np.diff(labels[order])) + 1):
        if len(group) >= LEAST_FACETS:
            yield rows[group]


def _fitted(rows: NDArray[np.int64], flat: _Flat) -> list[_Piece]:
    """Return the cylinder or the slot that facets form, or the arcs of a wall that is partly plane."""
    fit = _circle(rows, flat) or _slot(rows, flat)
    if fit is not None:
        return [fit]
    chords = np.linalg.norm(np.ptp(flat.points[rows], axis=1), axis=1)
    short = rows[chords < LONG * np.median(chords)]
    if len(short) == len(rows):
        return []
    return [fit for piece in _pieces(short, flat) if (fit := _circle(piece, flat)) is not None]


def _circle(rows: NDArray[np.int64], flat: _Flat) -> _Piece | None:
    points = np.unique(np.round(flat.points[rows].reshape(-1, 2), 4), axis=0)
    if len(points) < 5:
        return None
    start = points.mean(axis=0)
    away = points - start
    (x, y, c), *_ = np.linalg.lstsq(np.column_stack([2 * away, np.ones(len(away))]), (away**2).sum(axis=1), rcond=None)
    radius, middle = math.sqrt(max(c + x * x + y * y, 0.0)), start + np.array([x, y])
    if np.abs(np.linalg.norm(points - middle, axis=1) - radius).max() > OFF_MM + OFF_SHARE * radius:
        return None
    return _wall(rows, flat, middle, radius, np.zeros(2))


def _slot(rows: NDArray[np.int64], flat: _Flat) -> _Piece | None:
    points = np.unique(np.round(flat.points[rows].reshape(-1, 2), 4), axis=0)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    away, turn = points - middle, 0.0
    for step in (math.radians(1.0), math.radians(0.01)):  # across it is narrowest
        turns = turn + step * np.arange(-90, 91)
        spans = np.ptp(away @ np.stack([-np.sin(turns), np.cos(turns)]), axis=0)
        turn, radius = float(turns[int(np.argmin(spans))]), float(spans.min()) / 2
    along = np.array([math.cos(turn), math.sin(turn)])
    half = float(np.ptp(away @ along)) / 2 - radius
    if half <= 0 or radius < LEAST_RADIUS_MM:
        return None
    clamped = np.clip(away @ along, -half, half)[:, None] * along
    if np.abs(np.linalg.norm(away - clamped, axis=1) - radius).max() > OFF_MM + OFF_SHARE * (half + radius):
        return None
    return _wall(rows, flat, middle, radius, half * along)


def _wall(rows: NDArray[np.int64], flat: _Flat, middle: Array, radius: float, stretch: Array) -> _Piece:
    away = flat.points[rows] - middle
    inwards = np.einsum("ij,ij->i", away.mean(axis=1), flat.normals[rows])
    angles = np.arctan2(away[..., 1], away[..., 0])
    over_the_cut = np.ptp(angles, axis=1) > math.pi
    angles[over_the_cut] %= 2 * math.pi
    sectors = np.zeros(SECTORS, dtype=bool)
    for first, last in np.stack([angles.min(axis=1), angles.max(axis=1)], axis=1) * SECTORS / (2 * math.pi):
        sectors[np.arange(math.floor(first + 0.02), math.floor(last - 0.02) + 1) % SECTORS] = True
    heights = flat.heights[rows]
    low, high = float(heights.min()), float(heights.max())
    return _Piece(middle, radius, low, high, bool(inwards.sum() < 0), sectors, stretch)


def _joined(pieces: list[_Piece]) -> list[_Piece]:
    """Join pieces of one cylinder that touch along its axis."""
    joined: list[_Piece] = []
    for piece in sorted(pieces, key=lambda each: (each.low, each.radius, *each.middle)):
        for i, below in enumerate(joined):
            if piece.goes_on(below):
                joined[i] = replace(below, high=max(piece.high, below.high), sectors=piece.sectors | below.sectors)
                break
        else:
            joined.append(piece)
    return joined

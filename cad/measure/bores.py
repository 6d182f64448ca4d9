"""Holes of a device: cylinders in a mesh, those of one axis joined, with mouth, depth and likely screw. Millimetres."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from scanwright.cad.geometry.holes import triple
from scanwright.cad.screws import SCREWS
from scanwright.design.arrays import Array
from scanwright.design.scene.ray_caster import Scene, build_scene, cast

CLOSED = 0.95  # share of the full turn: least of the wall of a hole
TIP = 0.6  # times the diameter: a surface so near beyond the wall is the hole's bottom (a drill's tip is 0.3)
RIM_MM = 0.8  # beyond the wall, for detecting the face about the mouth
CHAMFER = 1.2  # times the diameter: largest distance of that face from the end of the wall
CORE_SHARE, CORE_MM = 0.02, 0.07  # of a modelled core from ISO 2306
MODELLED_MM = 0.07  # of a thread that is modelled with its outer diameter
PASSING = (0.07, 0.1, 0.2)  # a hole that a screw passes is wider by at least a, at most b + c times the screw
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


@dataclass(frozen=True, slots=True)
class Bore:
    """A hole that opens to the outside."""

    mouth: tuple[float, float, float]  # middle of its mouth, in the face about it
    out: tuple[float, float, float]  # unit vector out of the device
    diameter: float  # of its narrowest wall
    depth: float  # from the face to the end of that wall
    # height beyond the other end of a hole that goes through, inf if it opens to the outside; 0 if it is blind
    free: float
    slot: float  # length of a slot, 0 for a round hole


def bores_of(triangles: Array, walls: Iterable[Wall], preferred: Sequence[float] = (0.0, 0.0, -1.0)) -> list[Bore]:
    """Return the holes that open to the outside, in a fixed order; corners of shape (t, 3, 3).

    A hole through the device opens on the side `preferred` if both sides are alike.
    """
    scene = build_scene(triangles)
    groups: dict[tuple[int, ...], list[Wall]] = {}
    for wall in walls:
        if wall.hole and wall.around >= CLOSED:
            key = tuple(np.round(np.array([*wall.axis, *wall.middle]) / (2 * SAME_MM)).astype(int).tolist())
            groups.setdefault(key, []).append(wall)
    bores = [bore for group in groups.values() for bore in _along_one_axis(scene, group, np.asarray(preferred))]
    return sorted(bores, key=lambda bore: (bore.out, bore.diameter, bore.mouth))


def _along_one_axis(scene: Scene, walls: list[Wall], preferred: Array) -> list[Bore]:
    """Return the holes of walls with a common axis."""
    walls = sorted(walls, key=lambda wall: wall.low + wall.high)
    axis = np.asarray(walls[0].axis)
    middles = np.array([wall.at((wall.low + wall.high) / 2) for wall in walls])
    up, down = (cast(scene, middles, np.broadcast_to(along, middles.shape)).range_m for along in (axis, -axis))
    runs: list[list[int]] = []
    for i, wall in enumerate(walls):
        below = walls[i - 1]
        if i and (wall.low + wall.high - below.low - below.high) / 2 < up[i - 1] + SAME_MM:
            runs[-1].append(i)
        else:
            runs.append([i])
    bores = []
    for run in runs:
        first, last = walls[run[0]], walls[run[-1]]
        beyond = {
            -1: down[run[0]] - (first.high - first.low) / 2,
            1: up[run[-1]] - (last.high - last.low) / 2,
        }
        bore = _bore(scene, [walls[i] for i in run], beyond, preferred)
        if bore is not None:
            bores.append(bore)
    return bores


def _bore(scene: Scene, walls: list[Wall], beyond: dict[int, float], preferred: Array) -> Bore | None:
    """Return the hole of a run of walls; `beyond` has the free height at its lower (-1) and upper end."""
    axis = np.asarray(walls[0].axis)
    narrow = min(walls, key=lambda wall: (wall.radius, wall.low))
    ends = {-1: walls[0], 1: walls[-1]}
    mouths = {sign: _face(scene, ends[sign], sign) for sign in ends if np.isinf(beyond[sign])}
    if not mouths:
        return None
    box = np.stack([scene.triangles_m.min(axis=(0, 1)), scene.triangles_m.max(axis=(0, 1))])

    def order(sign: int) -> tuple[float, float, float]:
        side = sign * axis
        extreme = (np.where(side > 0, box[1], box[0]) - ends[sign].at(mouths[sign])) @ side
        return round(ends[sign].radius - narrow.radius, 2), round(float(extreme), 1), -float(side @ preferred)

    sign = min(mouths, key=order)
    face, end = mouths[sign], narrow.low if sign > 0 else narrow.high
    free = beyond[-sign] if beyond[-sign] > TIP * 2 * narrow.radius else 0.0
    length = 2 * (float(np.linalg.norm(narrow.stretch)) + narrow.radius) if any(narrow.stretch) else 0.0
    out, mouth = triple(sign * axis), triple(np.round(narrow.at(face), 3))
    return Bore(mouth, out, round(2 * narrow.radius, 3), round(abs(face - end), 3), float(free), round(length, 3))


def _face(scene: Scene, wall: Wall, sign: int) -> float:
    """Return the height along the axis of the face about the mouth of a wall; that of its end if there is none."""
    axis, end = np.asarray(wall.axis), wall.high if sign > 0 else wall.low
    aside = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    aside /= np.linalg.norm(aside)
    turns = np.arange(8) * np.pi / 4
    around = np.outer(np.cos(turns), aside) + np.outer(np.sin(turns), np.cross(axis, aside))
    reach = CHAMFER * 2 * wall.radius
    heights = []
    for rim in (RIM_MM, 2 * RIM_MM):  # a second ring, outside of a chamfer
        starts = wall.at(end + sign * reach) + (wall.radius + rim) * around
        hits = cast(scene, starts, np.broadcast_to(-sign * axis, starts.shape)).range_m
        near = end + sign * (reach - hits[hits < 2 * reach])
        heights += [round(float(height), 3) for height in near if sign * (height - end) > -SAME_MM]
    if not heights:
        return end
    return max(set(heights), key=lambda height: (heights.count(height), sign * height))


def likely_screws(bore: Bore) -> list[tuple[str, str]]:
    """Return the kind of hole and size of screw, the likelier first; none if no screw fits.

    A blind hole is assumed to be a thread, modelled by its core (ISO 2306) or its outer diameter; a through hole may
    also be a clearance hole.
    """
    d = bore.diameter
    sizes = [(s.core, s.name) for s in SCREWS.values() if abs(d - s.core) < CORE_MM + CORE_SHARE * s.nominal]
    sizes += [(s.nominal, s.name) for s in SCREWS.values() if abs(d - s.nominal) < MODELLED_MM]
    threads = [("tapped", name) for _, name in sorted(sizes, key=lambda size: round(abs(d - size[0]), 2))]
    if not bore.free:
        return list(dict.fromkeys(threads))
    least, most, share = PASSING
    passing = [s for s in SCREWS.values() if least < d - s.nominal < most + share * s.nominal]
    return [*(("through", s.name) for s in reversed(passing)), *dict.fromkeys(threads)]

"""A short path of a cable through the free space: straight pieces with an arc of one radius at each corner.

The arcs are tangent to the straight pieces, so the radius is kept; pieces that are too short have no path.

Straight pieces between the points of a lattice make the graph; the result is a short chain of them whose corners leave
space for their arcs. Each piece provides at most half of its length to the arc at either end, so that any chain of
allowed neighbours is a path.
"""

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from scanwright.design.arrays import Array, Mask

SAMPLE = 3.0  # mm between two tested points
AZIMUTHS = 24
FROM_HUB = 4.0  # first radius of the lattice
STEP = 12.0  # of its radii and heights
BEYOND = 12.0  # of the lattice beyond the furthest end
REACH = 40.0  # of a piece between two points of the lattice
GREED = 1.2  # weight of the remaining length: a path at most a fifth longer, in half the time
ARRIVALS = 6  # at a point that are continued: none of 28 paths was lost or longer than with all of them
SHARPEST = math.radians(125.0)
GAP = 0.6  # between a lead and obstacles
ROUNDING = 0.3  # more along the straight pieces
STRAIGHT = 1e-6  # rad: less is no corner


@dataclass(frozen=True, slots=True)
class PathPiece:
    """One straight piece or arc."""

    start: Array  # shape (3,)
    middle: Array  # on the arc, or halfway along the straight, shape (3,)
    end: Array  # shape (3,)
    length: float  # along it
    straight: bool  # whether it is no arc


@dataclass(frozen=True, slots=True)
class Path:
    """Corners (n, 3) and the radius of the arcs between them."""

    corners: tuple[tuple[float, float, float], ...]
    radius: float

    def tangents(self) -> Array:
        """Return the tangent length of the arc at each corner, 0 at the ends, shape (n,)."""
        inner = self.radius * np.tan(turns(np.array(self.corners)) / 2)
        return np.concatenate([[0.0], inner, [0.0]])

    def slack(self) -> float:
        """Return the least length of a straight piece between its arcs; there is no such path below zero."""
        lengths = np.linalg.norm(np.diff(np.array(self.corners), axis=0), axis=1)
        tangents = self.tangents()
        return float((lengths - tangents[:-1] - tangents[1:]).min())

    def pieces(self) -> list[PathPiece]:
        """Return straights and arcs in order, without straights of no length.

        Raises:
            ValueError: the corners are too near to each other for the radius.
        """
        if self.slack() < -1e-6:
            raise ValueError(
                f"radius {self.radius:g} mm: the corners are {-self.slack():.2f} mm too near to each other"
            )
        corners, tangents = np.array(self.corners, dtype=float), self.tangents()
        along = np.diff(corners, axis=0)
        along /= np.linalg.norm(along, axis=1)[:, None]
        angles = np.concatenate([[0.0], turns(corners), [0.0]])
        pieces, here = [], corners[0]
        for i, direction in enumerate(along):
            there = corners[i + 1] - tangents[i + 1] * direction
            length = float((there - here) @ direction)
            if length > 1e-6:
                pieces.append(PathPiece(here, (here + there) / 2, there, length, True))
            here = there
            if angles[i + 1] > STRAIGHT:
                here = corners[i + 1] + tangents[i + 1] * along[i + 1]
                inwards = along[i + 1] - direction
                inwards /= np.linalg.norm(inwards)
                depth = self.radius * (1 / math.cos(angles[i + 1] / 2) - 1)
                middle = corners[i + 1] + depth * inwards
                pieces.append(PathPiece(there, middle, here, float(self.radius * angles[i + 1]), False))
        return pieces

    def length(self) -> float:
        """Return the length from end to end."""
        return sum(piece.length for piece in self.pieces())

    def least_radius(self) -> float:
        """Return the smallest radius of its arcs, from their ends and middles."""
        radii = [math.inf]
        for piece in self.pieces():
            if not piece.straight:
                chord = float(np.linalg.norm(piece.end - piece.start))
                depth = float(np.linalg.norm((piece.start + piece.end) / 2 - piece.middle))
                radii.append(depth / 2 + chord**2 / (8 * depth))
        return round(min(radii), 6)

    def points(self, step: float) -> Array:
        """Return points along it at most a step apart, shape (n, 3)."""
        runs = []
        for piece in self.pieces():
            share = np.linspace(0.0, 1.0, max(2, math.ceil(piece.length / step) + 1))[:, None]
            if piece.straight:
                runs.append(piece.start + share * (piece.end - piece.start))
                continue
            # on the circle: start and end seen from its centre, turned from one to the other
            chord = (piece.start + piece.end) / 2 - piece.middle
            centre = piece.middle + self.radius * chord / np.linalg.norm(chord)
            angle, one, other = piece.length / self.radius, piece.start - centre, piece.end - centre
            runs.append(centre + (np.sin((1 - share) * angle) * one + np.sin(share * angle) * other) / math.sin(angle))
        return np.concatenate(runs)


def turns(corners: Array) -> Array:
    """Return the angle by which a polyline turns at each inner corner [rad], shape (n - 2,)."""
    along = np.diff(corners, axis=0)
    along = along / np.linalg.norm(along, axis=1)[:, None]
    cosine = np.einsum("ij,ij->i", along[:-1], along[1:])
    sine = np.linalg.norm(np.cross(along[:-1], along[1:]), axis=1)
    return np.asarray(np.arctan2(sine, cosine))


class CableSpace(Protocol):
    """Space for a cable."""

    def free(self, points: Array, half: float, gap: float) -> Mask:
        """Return whether a ball of radius `half` at each point (n, 3) keeps `gap` to everything, shape (n,)."""
        ...


Stiff = tuple[Array, float]  # direction of a stiff end at its tip, and its length available for an arc


@dataclass(frozen=True, slots=True)
class Ending:
    """A stiff end of a cable: points that it must pass, the last of them with a free length behind."""

    corners: Array  # from the very end on, shape (k, 3); the cable continues along `direction`
    direction: Array  # unit vector, shape (3,)
    lengths: tuple[float, ...]  # to try, of the piece behind the last corner
    used: float  # start of the piece behind the last corner that no arc may use: an arc there, or a clamp
    clamped: float  # length of that piece that may be near its device

    def tips(self) -> Array:
        """Return the possible starts of the free part of the lead, shape (m, 3)."""
        return np.asarray(self.corners[-1] + np.array(self.lengths)[:, None] * self.direction)


def short_path(
    space: CableSpace, starts: Sequence[Ending], goals: Sequence[Ending], half: float, radius: float, lattice: Array
) -> Path | None:
    """Return a short path between two ends, within GREED of the shortest; None if there is none.

    `starts` and `goals` are alternative ends at either device, `lattice` are points of possible corners, shape (n, 3).
    """
    first, last = (
        [(end, tip) for end in ends for tip in range(len(end.lengths)) if _clear(space, end, tip, half)]
        for ends in (starts, goals)
    )
    if not first or not last:
        return None
    lattice = lattice[space.free(lattice, half, GAP + ROUNDING)]
    points = np.concatenate([[end.tips()[tip] for end, tip in first], lattice, [end.tips()[tip] for end, tip in last]])
    beyond = len(first) + len(lattice)
    chain = PathGraph(space, half, radius, points).chain(
        {i: (end.direction, end.lengths[tip] - end.used) for i, (end, tip) in enumerate(first)},
        dict(enumerate(last, start=beyond)),
    )
    if not chain:
        return None
    start, goal = first[chain[0]][0], last[chain[-1] - beyond][0]
    corners = np.concatenate([start.corners, points[chain], goal.corners[::-1]])
    return Path(tuple((float(x), float(y), float(z)) for x, y, z in corners), radius)


def lattice_about_axis(floor: float, half: float, hub: float, ends: Sequence[Ending]) -> Array:
    """Return points about the axis, from a hub to beyond some ends, above a floor, shape (n, 3)."""
    low, tips = floor + half + GAP + ROUNDING, np.concatenate([end.tips() for end in ends])
    turn = 2 * math.pi * np.arange(AZIMUTHS) / AZIMUTHS
    radius = np.arange(hub + FROM_HUB, float(np.hypot(tips[:, 0], tips[:, 1]).max()) + BEYOND, STEP)
    height = np.arange(low + 0.5, float(tips[:, 2].max()) + BEYOND, STEP)
    t, r, z = (a.ravel() for a in np.meshgrid(turn, radius, height, indexing="ij"))
    return np.column_stack([r * np.cos(t), r * np.sin(t), z])


def _clear(space: CableSpace, end: Ending, tip: int, half: float) -> bool:
    """Return whether the straight piece of a stiff end is free outside its device."""
    first, last = min(end.clamped, end.lengths[tip]), end.lengths[tip]
    along = np.linspace(first, last, math.ceil((last - first) / SAMPLE) + 1)
    return bool(space.free(end.corners[-1] + along[:, None] * end.direction, half, GAP).all())


@dataclass(frozen=True, slots=True)
class _Ends:
    """The stiff pieces that begin at the last points: number of the first of these, and data of each."""

    first: int
    directions: Array  # towards the device, shape (k, 3)
    left: Array  # length available for an arc, shape (k,)
    corners: Array  # at the device, shape (k, 3)
    clamped: Array  # distance from there that may be near the device, shape (k,)


@dataclass(frozen=True, slots=True)
class PathGraph:
    """Points (n, 3) where a cable may turn, and the straight pieces between them, computed when needed."""

    space: CableSpace  # space for the cable
    half: float  # radius of the cable
    radius: float  # of the arcs between two pieces
    points: Array  # first those at the ring, last those at the lidar
    _joined: dict[int, tuple[NDArray[np.int64], Array, Array]] = field(default_factory=dict, init=False, repr=False)

    def chain(self, starts: dict[int, Stiff], goals: dict[int, tuple[Ending, int]]) -> list[int]:
        """Return the points of a short chain of pieces from a start to a goal; empty if there is none.

        Args:
            starts: first points, the direction of the stiff piece that ends there, and its length left for an arc.
            goals: last points, the stiff end that begins there, and the number of its length.
        """
        left = GREED * np.linalg.norm(self.points[:, None] - self.points[list(goals)], axis=2).min(axis=1)
        last = [(-end.direction, end.lengths[n] - end.used, end.corners[-1], end.clamped) for end, n in goals.values()]
        ends = _Ends(min(goals), *(np.array(each) for each in zip(*last, strict=True)))
        # a piece is known by its two points; before the first one is the stiff end
        shortest: dict[int, Array] = {}  # of all chains so far that end with each piece from a point
        came: dict[tuple[int, int], tuple[int, int]] = {}
        arrived: dict[int, int] = {}
        queue = [(float(left[i]), 0.0, -1, i, 0) for i in starts]
        heapq.heapify(queue)
        while queue:
            _, length, before, here, piece = heapq.heappop(queue)
            if before >= 0 and shortest[before][piece] < length:
                continue
            if here in goals and before >= 0:
                return _back(came, (before, here))
            arrived[here] = arrived.get(here, 0) + 1
            if arrived[here] > ARRIVALS:
                continue
            stiff = starts[here] if before < 0 else self._piece(before, here)
            others, _, lengths = self._pieces_at(here)
            known = shortest.setdefault(here, np.full(len(others), np.inf))
            for onto in self._onwards(here, stiff, ends, length + lengths < known - 1e-9):
                so_far, there = length + float(lengths[onto]), int(others[onto])
                known[onto], came[here, there] = so_far, (before, here)
                heapq.heappush(queue, (so_far + float(left[there]), so_far, here, there, int(onto)))
        return []

    def _piece(self, start: int, end: int) -> Stiff:
        along = self.points[end] - self.points[start]
        length = float(np.linalg.norm(along))
        return along / length, length / 2

    def _onwards(self, here: int, stiff: Stiff, ends: _Ends, open_: Mask) -> NDArray[np.int64]:
        """Return which of the open pieces from a point can follow a stiff one."""
        others, along, lengths = self._pieces_at(here)
        direction, left = stiff
        fits = open_ & (_arc(self.radius, along @ direction) <= np.minimum(left, lengths / 2))
        last = np.flatnonzero(others >= ends.first)
        if len(last):
            end = others[last] - ends.first
            turn = np.einsum("ij,ij->i", along[last], ends.directions[end])
            fits[last] &= _arc(self.radius, turn) <= np.minimum(ends.left[end], lengths[last] / 2)
        chosen = np.flatnonzero(fits)
        inside = self.points[here] + _on_arcs(self.radius, direction, along[chosen])
        free = self.space.free(inside.reshape(-1, 3), self.half, GAP).reshape(len(inside), -1).all(axis=0)
        chosen = chosen[free]
        return chosen[np.array([self._arrives(along[k], int(others[k]), ends) for k in chosen], dtype=bool)]

    def _arrives(self, along: Array, there: int, ends: _Ends) -> bool:
        """Return whether a piece ends at no last point, or the arc there is free outside its device."""
        end = there - ends.first
        if end < 0:
            return True
        arc = self.points[there] + _on_arcs(self.radius, along, ends.directions[end, None])[:, 0]
        outside = np.linalg.norm(arc - ends.corners[end], axis=1) > ends.clamped[end]
        return bool((self.space.free(arc, self.half, GAP) | ~outside).all())

    def _pieces_at(self, here: int) -> tuple[NDArray[np.int64], Array, Array]:
        """Return points reached by a free straight piece, directions (m, 3) and lengths (m,)."""
        if here not in self._joined:
            along = self.points - self.points[here]
            lengths = np.linalg.norm(along, axis=1)
            others = np.flatnonzero((lengths > self.radius) & (lengths < REACH))
            share = np.linspace(0.0, 1.0, math.ceil(REACH / SAMPLE) + 1)[1:, None, None]
            samples = self.points[here] + share * along[others]
            free = self.space.free(samples.reshape(-1, 3), self.half, GAP + ROUNDING)
            others = others[free.reshape(len(share), -1).all(axis=0)]
            self._joined[here] = others, along[others] / lengths[others, None], lengths[others]
        return self._joined[here]


def _back(came: dict[tuple[int, int], tuple[int, int]], last: tuple[int, int]) -> list[int]:
    chain = [last[1]]
    while last[0] >= 0:
        chain.append(last[0])
        last = came[last]
    return chain[::-1]


def _arc(radius: float, cosine: Array) -> Array:
    """Return the tangent length of an arc between two pieces, infinite if they turn back."""
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    return np.where(angle < SHARPEST, radius * np.tan(np.minimum(angle, SHARPEST) / 2), np.inf)


def _on_arcs(radius: float, direction: Array, along: Array) -> Array:
    """Return vectors from a corner to the quarters of its arc, for each next direction (m, 3): shape (3, m, 3).

    The widest arcs are four times as long as SAMPLE.
    """
    half = np.arccos(np.clip(along @ direction, -1.0, 1.0)) / 2
    turned = np.array([-0.5, 0.0, 0.5])[:, None] * half
    inwards = radius * (1 / np.cos(half) - np.cos(turned)) / np.maximum(2 * np.sin(half), 1e-9)
    onwards = radius * np.sin(turned) / np.maximum(2 * np.cos(half), 1e-9)
    return np.asarray(inwards[..., None] * (along - direction) + onwards[..., None] * (along + direction))

"""A smooth path: straight pieces with an arc of one radius at each corner. Millimetres.

The arcs are tangent to the straight pieces, so the radius is kept; pieces that are too short have no path.
"""

import math
from dataclasses import dataclass

import numpy as np

from scanwright.design.arrays import Array

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

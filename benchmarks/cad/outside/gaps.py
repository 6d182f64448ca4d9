"""Least distance of what turns from what does not over a whole turn, and overlap of solids.

A turning and a fixed point come as near at some angle as their radius and height are: points spread over both surfaces
are compared in the half plane about the axis, then again with ten times as many where they came nearest.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.cad.outside.bodies import Array, StepBody

NEAR_MM = 5.0  # surfaces further apart are not compared
COARSE_MM, FINE_MM = 0.4, 0.04  # spacing of the points
MARGIN_MM = 0.5  # that the first pass may be wrong by
CELLS = 2**24  # along the axis, more than any scanner has
OVERLAP_MM3 = 0.05  # below it: error of the meshes
HALVES = ({"servo_case", "servo_horn"}, {"ring_stator", "ring_rotor"}, {"belt", "shaft_pulley"})


def meet(one: str, other: str) -> bool:
    """Return whether two bodies touch by design: halves of a device, or a bearing's rings."""
    return {one, other} in HALVES or (one.startswith("bearing_") and other.startswith("bearing_"))


def turning_gap(
    bodies: Mapping[str, StepBody], turning: Collection[str], extra: Mapping[str, tuple[bool, Array]] | None = None
) -> tuple[float, str]:
    """Return the least distance over a turn [mm] and the two bodies; `extra` has points of bodies by name."""
    images = {name: (name in turning, _image(body.mesh, COARSE_MM)) for name, body in bodies.items()}
    images |= {name: (turns, _flat(points)) for name, (turns, points) in (extra or {}).items()}
    pairs = []
    for (one, (_, a)), (other, (_, b)) in itertools.product(
        [each for each in images.items() if each[1][0]], [each for each in images.items() if not each[1][0]]
    ):
        if not meet(one, other) and _boxes_near(a, b, NEAR_MM):
            pairs.append((float(cKDTree(a).query(b, distance_upper_bound=NEAR_MM)[0].min()), one, other))
    best = (NEAR_MM, "none")
    for coarse, one, other in sorted(pairs):
        if coarse - MARGIN_MM > best[0]:
            break
        near = coarse + MARGIN_MM
        a, b = (_refined(bodies.get(name), images[name][1]) for name in (one, other))
        a, b = a(images[other][1], near), b(images[one][1], near)
        if len(a) and len(b):
            best = min(best, (float(cKDTree(a).query(b)[0].min()), f"{one} and {other}"))
    return best


def overlaps(bodies: Mapping[str, StepBody]) -> Iterator[tuple[float, str]]:
    """Yield the volume [mm3] that two solids share, as drawn, and their names, if it is more than the meshes' error."""
    import manifold3d

    solids = {name: manifold3d.Manifold(_whole(body.mesh)) for name, body in bodies.items()}
    for one, other in itertools.combinations(sorted(bodies), 2):
        if _boxes_near(bodies[one].mesh.bounds, bodies[other].mesh.bounds, 0.0):
            volume = float((solids[one] ^ solids[other]).volume())
            if volume > OVERLAP_MM3:
                exact = bodies[one].shape.intersect(bodies[other].shape)
                volume = float(exact.Volume()) if exact else 0.0
            if volume > OVERLAP_MM3:
                yield volume, f"{one} and {other}"


def _whole(mesh: Any) -> Any:
    import manifold3d

    return manifold3d.Mesh(np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces, dtype=np.uint32))


def _flat(points: Array) -> Array:
    return np.column_stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]])


def _image(mesh: Any, spacing: float) -> Array:
    """Return points over a mesh, spread by its triangles, in the half plane; shape (n, 2)."""
    points = _spread(np.asarray(mesh.triangles), spacing)
    cells = np.round(_flat(points) / (spacing / 4)).astype(np.int64)
    keys = np.unique(cells[:, 0] * CELLS + cells[:, 1] + CELLS // 2)
    return np.column_stack([keys // CELLS, keys % CELLS - CELLS // 2]) * (spacing / 4)


def _spread(triangles: Array, spacing: float) -> Array:
    """Return points over triangles, no further apart than about a spacing; corners and edges are among them."""
    edge = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    pieces = np.maximum(1, np.ceil(edge / spacing)).astype(int)
    points = []
    for count in np.unique(pieces):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
        weights = np.stack([i, j, count - i - j], axis=-1)[i + j <= count] / count
        points.append((weights @ triangles[pieces == count]).reshape(-1, 3))
    return np.concatenate(points)


def _refined(body: StepBody | None, coarse: Array) -> Any:
    """Return a function that gives fine points of a body within a distance of an image."""

    def near(image: Array, distance: float) -> Array:
        tree = cKDTree(image)
        if body is None:
            return coarse
        triangles = np.asarray(body.mesh.triangles)
        for spacing in (4 * COARSE_MM, COARSE_MM, 4 * FINE_MM):  # split, keep the pieces that are near
            triangles = _split(triangles, spacing)
            size = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
            middle = _flat(triangles.mean(axis=1))
            triangles = triangles[tree.query(middle)[0] < distance + size + COARSE_MM]
        return _flat(_spread(triangles, FINE_MM)) if len(triangles) else np.empty((0, 2))

    return near


def _split(triangles: Array, size: float) -> Array:
    """Halve the longest edges of triangles until none is longer than a size."""
    done = []
    while len(triangles):
        edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        long = edges.max(axis=1) > size
        done.append(triangles[~long])
        triangles, edges = triangles[long], edges[long]
        first = edges.argmax(axis=1)
        a, b, c = (triangles[np.arange(len(triangles)), (first + k) % 3] for k in range(3))
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done) if done else triangles


def _boxes_near(one: Array, other: Array, distance: float) -> bool:
    low, high = one.min(axis=0), one.max(axis=0)
    return bool((low - distance <= other.max(axis=0)).all() and (other.min(axis=0) - distance <= high).all())

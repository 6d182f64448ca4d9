"""What an eye finds on the assembled scanner: faces that nothing lies on or stands before. Millimetres.

The scanner stands on its deck, which ends nowhere: what faces it from nearby cannot be read. What turns is looked at in
four positions of the servo: a person turns it by hand.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.labels.flats import Flat
from scanwright.design.arrays import Array
from scanwright.design.scene import ray_caster

READING = 200.0  # from a face to the eye: what stands farther off leaves room for a head
TOUCH = 1.0  # a body nearer to a face than this lies on it
OFF = 0.05  # from the face to where the looks start
DECK_HALF = 2000.0
DECK_BELOW = 0.2  # of its face in this picture: a foot that lies on it is found to touch it
GRID = 3.0  # between the points of a face where touch is looked for


class Visibility:
    """Bodies and deck of one scanner, to look at the faces of its parts."""

    def __init__(self, assembly: Assembly) -> None:
        corners: dict[bool, list[Array]] = {True: [], False: [_deck(assembly)]}
        turning = assembly.turning()
        for name, mesh in assembly.meshes().items():
            corners[name in turning].append(mesh.vertices[mesh.faces])
        self._scenes = {
            turning: ray_caster.build_scene(np.concatenate(all_) / 1000) for turning, all_ in corners.items()
        }

    def touched(self, flat: Flat) -> bool:
        """Whether anything lies on a face."""
        x0, y0, x1, y1 = flat.outline.bounds
        xs, ys = np.arange(x0 + GRID / 2, x1, GRID), np.arange(y0 + GRID / 2, y1, GRID)
        points = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=2).reshape(-1, 2)
        inside = points[shapely.contains_xy(flat.outline.buffer(-0.2), points[:, 0], points[:, 1])]
        return any(bool((self._distance(flat, inside, other, 0) < TOUCH).any()) for other in self._scenes)

    def views(self, flat: Flat, points: Array, turning: bool) -> NDArray[np.bool_]:
        """Which points of a face an eye straight before them sees, a row for each position of the servo, shape (4, n).

        Args:
            flat: a face of some part.
            points: in its axes, shape (n, 2).
            turning: whether that part turns with the horn.
        """
        own = self._distance(flat, points, turning, 0) > READING
        return np.stack([own & (self._distance(flat, points, not turning, q) > READING) for q in range(4)])

    def _distance(self, flat: Flat, points: Array, turning: bool, quarter: int) -> Array:
        """From points of a face straight to a body of one kind, turned by quarters, shape (n,); 0 where it touches.

        A body that lies on the face holds the start of the ray, which then meets its surface from within.
        """
        turn = np.linalg.matrix_power([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], quarter)
        normal = flat.frame[:, 2]
        starts = (flat.at(points) + OFF * normal) / 1000 @ turn.T
        bodies = self._scenes[turning]
        hits = ray_caster.cast(bodies, starts, np.broadcast_to(turn @ normal, starts.shape))
        within = (hits.triangle >= 0) & (bodies.normals[hits.triangle] @ (turn @ normal) > 0)
        return np.asarray(1000 * np.where(within, 0.0, hits.range_m))


def _deck(assembly: Assembly) -> Array:
    """Two triangles, shape (2, 3, 3)."""
    axes, centre = assembly.layout.deck.rotation(), np.array(assembly.layout.deck.centre)
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * DECK_HALF
    corners = centre - DECK_BELOW * axes[:, 2] + square @ axes[:, :2].T
    return corners[[[0, 1, 2], [0, 2, 3]]]

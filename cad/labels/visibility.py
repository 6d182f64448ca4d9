"""Free distance in front of the faces of the parts of an assembled scanner. Millimetres.

The deck is endless and the servo is at joint 0.
"""

from collections.abc import Callable

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.labels.flats import Flat
from scanwright.design.arrays import Array
from scanwright.design.scene import ray_caster

OFF = 0.05  # from the face to the start of the rays
DECK_HALF = 2000.0
DECK_BELOW = 0.2  # of its face in this scene: a foot that lies on it then touches it

FreeDistance = Callable[[Flat, Array], Array]
"""Distances from points of a face, shape (n, 2), to the next body: shape (n,), 0 if it touches, inf if none."""


def free_distance(assembly: Assembly) -> FreeDistance:
    """Return a measurement by rays against all bodies of the assembly and its deck."""
    corners = [mesh.vertices[mesh.faces] for mesh in assembly.meshes().values()]
    bodies = ray_caster.build_scene(np.concatenate([_deck(assembly), *corners]) / 1000)

    def measured(flat: Flat, points: Array) -> Array:
        normal = flat.frame[:, 2]
        starts = (flat.at(points) + OFF * normal) / 1000
        hits = ray_caster.cast(bodies, starts, np.broadcast_to(normal, starts.shape))
        # a body on the face contains the start of the ray, which then meets its surface from within
        within = (hits.triangle >= 0) & (bodies.normals[hits.triangle] @ normal > 0)
        return np.asarray(1000 * np.where(within, 0.0, hits.range_m))

    return measured


def _deck(assembly: Assembly) -> Array:
    """Return the deck as two triangles, shape (2, 3, 3)."""
    axes, centre = assembly.layout.deck.rotation(), np.array(assembly.layout.deck.centre)
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * DECK_HALF
    corners = centre - DECK_BELOW * axes[:, 2] + square @ axes[:, :2].T
    return corners[[[0, 1, 2], [0, 2, 3]]]

"""Deformation of a mount under its load: finite elements on two grids, as in `sag`.

The deck is rigid and holds the foot under the washers of its screws alone; contact elsewhere makes it stiffer, by an
unknown amount. A face of the grid is on the deck.
"""

from dataclasses import dataclass

import numpy as np

from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.layout.deck import Deck
from scanwright.cad.layout.drive import Mounted
from scanwright.cad.statics import elastic
from scanwright.cad.statics.elastic import Grid, filled
from scanwright.cad.statics.sag import POISSON
from scanwright.cad.statics.spring import Spring, rigid_motion, shared_by, spring_of, wrenches
from scanwright.design.arrays import Array
from scanwright.design.frames import STANDARD_GRAVITY_M_S2

EDGES = (12.0, 8.0)  # mm, of the cells of the two grids
PARTS = 6  # cubes along the edge of a cell
STEP = 1.0  # mm, between points of a washer or a seat
INSIDE = 0.05  # mm below a face: points on it are in cells of the part


@dataclass(frozen=True, slots=True)
class Carried:
    """The load of a mount."""

    mass_kg: float  # of all of it
    centre_m: Array  # of all of it, rotation frame
    down: Array  # unit vector of gravity, rotation frame
    seat_mm: float  # radius of the faces around the holes that it lies on
    washer_mm: float  # radius of the washers under the heads of the deck's screws


def mount_sag(
    mesh: TriMesh, deck: Deck, mounted: Mounted, carried: Carried, modulus_mpa: float, density_g_cm3: float
) -> tuple[Array, Array, Spring]:
    """Return the deformation of the mount, a mesh in the rotation frame [mm], under its load.

    Rotation [rad] on the finer grid, and its error, rotation frame, shapes (3,); the mount as a spring between deck and
    servo.

    Raises:
        RuntimeError: nothing holds the mount.
    """
    coarse, fine = (_on_grid(edge, mesh, deck, mounted, carried, modulus_mpa, density_g_cm3) for edge in EDGES)
    return fine[0], (fine[0] - coarse[0]) / (EDGES[0] / EDGES[1] - 1), fine[1]


def _on_grid(
    edge: float, mesh: TriMesh, deck: Deck, mounted: Mounted, carried: Carried, modulus: float, density: float
) -> tuple[Array, Spring]:
    R, centre = deck.rotation(), np.array(deck.centre)
    triangles = ((mesh.vertices - centre) @ R)[mesh.faces]
    grid = _grid(triangles, edge)
    model = elastic.model_of(grid, filled(triangles, grid))
    washers = _discs(np.array(deck.deck_holes), INSIDE, carried.washer_mm, deck.screw.nominal / 2)
    clamped = elastic.places(model, washers)
    seats = _discs(np.array(mounted.holes), mounted.ears - INSIDE, carried.seat_mm, mounted.screw.nominal / 2)
    seats = (seats - centre) @ R
    at = elastic.places(model, seats)
    seats = seats[at.known]  # only points on the foot
    down = (R.T @ carried.down)[:, None] * STANDARD_GRAVITY_M_S2
    lever = R.T @ (carried.centre_m * 1000 - centre)
    loads = elastic.weight(model, density * 1e-6 * down)
    force = carried.mass_kg * down
    loads += elastic.pull(model, at, shared_by(seats, force, np.cross(lever, force, axisb=0, axisc=0)))
    origin = -R.T @ centre  # of the rotation frame
    both = np.concatenate([loads, wrenches(model, at, seats, origin)], axis=2)
    moved = elastic.solve(model, modulus, POISSON, clamped, len(washers) * STEP**2, both)
    rotation = rigid_motion(seats, elastic.moved(model, at, moved[:, :, :1]))[1][:, 0]
    return R @ rotation, spring_of(model, density, (at, seats, moved[:, :, 1:]), R, origin)


def _grid(triangles: Array, edge: float) -> Grid:
    """Return a grid around all triangles, with a face at the deck's height."""
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    middle = (low + high) / 2
    cells = np.maximum(np.ceil((high - low) / edge), 1).astype(int)
    start = middle - edge * cells / 2
    start[2] = 0.0
    return Grid(start, edge, (int(cells[0]), int(cells[1]), int(np.ceil(high[2] / edge))), PARTS)


def _discs(holes: Array, height: float, radius: float, hole: float) -> Array:
    """Return points of rings around some holes, shape (n, 3)."""
    along = np.arange(-radius + STEP / 2, radius, STEP)
    x, y = (each.ravel() for each in np.meshgrid(along, along, indexing="ij"))
    ring = (np.hypot(x, y) < radius) & (np.hypot(x, y) > hole)
    disc = np.column_stack([x[ring], y[ring]])
    flat = (holes[:, None, :] + disc).reshape(-1, 2)
    return np.column_stack([flat, np.full(len(flat), height)])

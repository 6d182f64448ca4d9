"""Displacement of the lidar by gravity along each axis of the rotation frame, and deformation of a mount by its load.

The printed parts between shaft and lidar by finite elements on two grids, the shaft as a beam. Linkage and sub-plate
are one body, bonded to the spigot; the lidar rests on its seat without stiffening it. Grids are along the laser frame:
the seat is a face of theirs. A cell bridges gaps narrower than itself; the two grids then differ, and the error
includes it.

Of a mount the deck is rigid and holds the foot under the washers of its screws alone; contact elsewhere makes it
stiffer, by an unknown amount. A face of the grid is on the deck.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.layout.deck import Deck
from scanwright.cad.layout.drive import Mounted
from scanwright.cad.layout.hub import Hub
from scanwright.cad.layout.loads import ShaftBend
from scanwright.cad.statics import elastic
from scanwright.cad.statics.elastic import Grid, filled
from scanwright.cad.statics.spring import Spring, rigid_motion, shared_by, spring_of, wrenches
from scanwright.design.arrays import Array
from scanwright.design.frames import STANDARD_GRAVITY_M_S2

EDGES = (8.0, 6.0)  # mm, of the cells of the two grids
PARTS = 6  # cubes along the edge of a cell
POISSON = 0.35
STEP = 1.0  # mm, between points of seat, spigot and washers
MOUNT_EDGES = (12.0, 6.0)  # mm, of the cells of the two grids
INSIDE = 0.05  # mm below a face: points on it are in cells of the part


@dataclass(frozen=True, slots=True)
class Sag:
    """Columns belong to gravity along x, y and z of the rotation frame, shape (3, 3) each."""

    rotation_rad: Array  # of the lidar, rotation vectors
    shift_m: Array  # of the optical centre
    rotation_error_rad: Array  # of the finite elements, with its sign
    shift_error_m: Array  # likewise
    spring: Spring  # the same parts as a spring between hub and lidar


def linkage_sag(
    stack: Hub, meshes: Sequence[TriMesh], seat: Array, lidar: Inertial, modulus_mpa: float, density_g_cm3: float
) -> Sag:
    """Return the sag of linkage and sub-plate, meshes in the rotation frame [mm].

    `seat` is half width, half depth and height of the lidar's seat [mm], `lidar` its body, both in the laser frame.
    """
    coarse, fine = (_on_grid(edge, stack, meshes, seat, lidar, modulus_mpa, density_g_cm3) for edge in EDGES)
    # remaining error if it falls linearly with the edge: that of the elements falls faster, of corners as fast
    errors = [(b - a) / (EDGES[0] / EDGES[1] - 1) for a, b in zip(coarse[:2], fine[:2], strict=True)]
    return Sag(fine[0], fine[1], errors[0], errors[1], fine[2])


def with_shaft(sag: Sag, shaft: ShaftBend, stack: Hub, rotor: Inertial) -> Sag:
    """Return the sag of linkage and shaft, which the entire rotor bends."""
    end = np.array([0.0, 0.0, stack.shoulder / 1000])
    turned, shifted = [], []
    for along in np.eye(3):
        force = rotor.mass_kg * STANDARD_GRAVITY_M_S2 * along
        moment = np.cross(rotor.centre_m - end, force)
        rotation = shaft.rotation_of(force, moment)
        turned.append(rotation)
        shifted.append(shaft.shift_of(force, moment) + np.cross(rotation, -end))
    return replace(
        sag,
        rotation_rad=sag.rotation_rad + np.stack(turned, axis=1),
        shift_m=sag.shift_m + np.stack(shifted, axis=1),
    )


def _on_grid(
    edge: float, stack: Hub, meshes: Sequence[TriMesh], seat: Array, lidar: Inertial, modulus: float, density: float
) -> tuple[Array, Array, Spring]:
    """Return rotation [rad] and shift [m] of one grid, and the spring, rotation frame."""
    R = stack.R()
    triangles = [(mesh.vertices @ R)[mesh.faces] for mesh in meshes]
    grid = _grid(np.concatenate(triangles), edge, float(seat[2]))
    body = np.max([filled(part, grid) for part in triangles], axis=0)
    model = elastic.model_of(grid, body)
    spigot, spigot_mm2 = _spigot(stack)
    clamped = elastic.places(model, spigot @ R)
    points, on_seat = _seat(grid, body, seat)
    at = elastic.places(model, points[on_seat])
    down = STANDARD_GRAVITY_M_S2 * R.T  # columns: gravity along each axis of the rotation frame, laser frame
    loads = elastic.weight(model, density * 1e-6 * down)
    lever = lidar.centre_m * 1000
    force = lidar.mass_kg * down
    loads += elastic.pull(model, at, shared_by(points[on_seat], force, np.cross(lever, force, axisb=0, axisc=0)))
    both = np.concatenate([loads, wrenches(model, at, points[on_seat], np.zeros(3))], axis=2)
    moved = elastic.solve(model, modulus, POISSON, clamped, spigot_mm2, both)
    shift, rotation = rigid_motion(points[on_seat], elastic.moved(model, at, moved[:, :, :3]))
    spring = spring_of(model, density, (at, points[on_seat], moved[:, :, 3:]), R, np.zeros(3))
    return R @ rotation, R @ shift / 1000, spring


def _grid(triangles: Array, edge: float, seat: float) -> Grid:
    """Return a grid around all triangles, with a face at the seat's height, symmetric about the lidar's axis."""
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    start = np.array([0.0, 0.0, seat])
    before, beyond = (np.ceil((start - low) / edge), np.ceil((high - start) / edge))
    shape = np.maximum(before + beyond, 1).astype(int)
    return Grid(start - edge * before, edge, (int(shape[0]), int(shape[1]), int(shape[2])), PARTS)


def _spigot(stack: Hub) -> tuple[Array, float]:
    """Return points all around the shaft in the hub, rotation frame, and the area."""
    radius, length = stack.shaft_diameter / 2, stack.cross_screw.spigot
    rows, around = max(4, round(length / STEP)), max(12, round(2 * np.pi * radius / STEP))
    z = stack.shoulder + (np.arange(rows) + 0.5) / rows * length
    angle, height = np.meshgrid(2 * np.pi * np.arange(around) / around, z)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=2)
    return points.reshape(-1, 3), 2 * np.pi * radius * length


def _seat(grid: Grid, body: Array, seat: Array) -> tuple[Array, Array]:
    """Return middles of the cubes' faces at the seat's height, and which of them support the lidar."""
    level = round((float(seat[2]) - float(grid.low[2])) / grid.edge) * grid.parts
    x, y = np.meshgrid(grid.middles(0), grid.middles(1), indexing="ij")
    lies = (body[:, :, level - 1] > 0.5) & (np.abs(x) < seat[0]) & (np.abs(y) < seat[1])
    points = np.stack([x, y, np.full_like(x, seat[2])], axis=2)
    return points.reshape(-1, 3), lies.reshape(-1)


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

    Rotation [rad] and its error, rotation frame, shapes (3,); the mount as a spring between deck and servo. Rotation
    and compliance are those of the finer grid and what is missing if their error falls with the square of the edge.

    Raises:
        RuntimeError: nothing holds the mount.
    """
    (turned, coarse), (finer, fine) = (
        _mount_on_grid(edge, mesh, deck, mounted, carried, modulus_mpa, density_g_cm3) for edge in MOUNT_EDGES
    )
    share = 1 / ((MOUNT_EDGES[0] / MOUNT_EDGES[1]) ** 2 - 1)
    more = share * (finer - turned)
    compliance = fine.compliance + share * (fine.compliance - coarse.compliance)
    if np.linalg.eigvalsh(compliance)[0] <= 0:  # the coarser grid is much too soft
        compliance = fine.compliance
    return finer + more, more, replace(fine, compliance=compliance)


def _mount_on_grid(
    edge: float, mesh: TriMesh, deck: Deck, mounted: Mounted, carried: Carried, modulus: float, density: float
) -> tuple[Array, Spring]:
    R, centre = deck.rotation(), np.array(deck.centre)
    triangles = ((mesh.vertices - centre) @ R)[mesh.faces]
    grid = _mount_grid(triangles, edge)
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


def _mount_grid(triangles: Array, edge: float) -> Grid:
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

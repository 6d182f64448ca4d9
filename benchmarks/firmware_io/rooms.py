"""Recordings of rooms that never were: rays against boxes in closed form, every error of the scanner known.

It shares no code with the estimator: its own rotations, its own frames, its own clock. The Cramer-Rao bound comes from
the same rays by finite differences, with every wall's own three parameters unknown and every beam's wall known.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from scanwright.firmware_io.recording.recording import recording_writer
from scanwright.firmware_io.samples import JointLog, Scan

Floats = NDArray[np.float64]
START_NS = 1_700_000_000_000_000_000


@dataclass(frozen=True, slots=True)
class Truth:
    """What is wrong with a scanner; the order is that of the bound.

    Attributes:
        tilt_x_rad, tilt_y_rad: rotation vector of the laser in the rotation frame, on the left of the design.
        offset_x_m, offset_y_m: laser's origin in the rotation frame.
        bias_m: what a range lacks.
        cos1_rad, sin1_rad, cos2_rad, sin2_rad: axis angle minus joint angle, first and second harmonic of the joint.
        lag_s: how late the joint log's stamps are.
        backlash_rad: play; the axis trails the joint by half of it, whichever way it turns.
    """

    tilt_x_rad: float = 0.0
    tilt_y_rad: float = 0.0
    offset_x_m: float = 0.0
    offset_y_m: float = 0.0
    bias_m: float = 0.0
    cos1_rad: float = 0.0
    sin1_rad: float = 0.0
    cos2_rad: float = 0.0
    sin2_rad: float = 0.0
    lag_s: float = 0.0
    backlash_rad: float = 0.0


NAMES = tuple(f.name for f in fields(Truth))


@dataclass(frozen=True, slots=True)
class Block:
    """A box: what stands in a room, or (seen from inside) the room itself."""

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    yaw_deg: float = 0.0


@dataclass(frozen=True, slots=True)
class Room:
    """Walls, what stands between them, and how far the lidar sees.

    Attributes:
        walls: the room, seen from inside.
        blocks: seen from outside.
        range_max_m: beams that find nothing nearer return nothing.
    """

    walls: Block
    blocks: tuple[Block, ...] = ()
    range_max_m: float = 60.0


FURNISHED = Room(
    Block((0.0, 0.0, 2.0), (20.0, 12.0, 4.0)),
    (
        Block((5.0, 3.5, 1.0), (2.0, 1.0, 2.0), 20.0),
        Block((-6.0, -3.0, 0.75), (1.5, 3.0, 1.5), -35.0),
        Block((7.0, -4.0, 1.5), (1.0, 1.0, 3.0), 10.0),
        Block((-4.0, 4.5, 0.5), (3.0, 1.2, 1.0), 5.0),
        Block((1.5, -4.5, 0.9), (2.0, 0.8, 1.8), 0.0),
        Block((-8.5, 1.0, 1.25), (1.0, 2.0, 2.5), 15.0),
        Block((3.0, 0.5, 3.4), (1.5, 1.5, 0.6), 30.0),
    ),
)
CORRIDOR = Room(Block((0.0, 0.0, 1.25), (400.0, 2.5, 2.5)), range_max_m=30.0)
EMPTY_HALL = Room(Block((0.0, 0.0, 500.0), (1000.0, 1000.0, 1000.0)), range_max_m=30.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """How a room was scanned.

    Attributes:
        laser_deg: designed (alpha_laser, beta_laser).
        rot_deg: designed (alpha_rot, beta_rot).
        position_m: where the scanner stands.
        fov_deg: of the lidar.
        beams: in it.
        rate_hz: scans a second.
        sweeps: (speed in deg/s, degrees to turn), one after the other.
        noise_m: standard deviation of a range.
        step_deg: steps of the servo's encoder; 0 for none.
    """

    laser_deg: tuple[float, float] = (60.0, 20.0)
    rot_deg: tuple[float, float] = (0.0, 0.0)
    position_m: tuple[float, float, float] = (3.0, 1.5, 1.2)
    fov_deg: float = 270.0
    beams: int = 1080
    rate_hz: float = 40.0
    sweeps: tuple[tuple[float, float], ...] = ((20.0, 360.0),)
    noise_m: float = 0.01
    step_deg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Unrest:
    """What should stand still and does not.

    Attributes:
        velocity_m_s: of the platform.
        walkers: how many people walk to and fro, as upright boxes.
    """

    velocity_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    walkers: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class _Beams:
    """All beams of a set-up, each shape (n,)."""

    time_s: Floats
    bearing_rad: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Simulated:
    """What a recording would hold."""

    scans: list[Scan]
    log: JointLog


@dataclass(frozen=True, slots=True)
class _Motion:
    """Joint angle over time: straight pieces between knots."""

    knots_s: tuple[float, ...]
    knots_rad: tuple[float, ...]

    @staticmethod
    def of(sweeps: tuple[tuple[float, float], ...]) -> _Motion:
        """One piece to a sweep, from angle 0."""
        seconds, angles = [0.0], [0.0]
        for speed, turned in sweeps:
            seconds.append(seconds[-1] + turned / abs(speed))
            angles.append(angles[-1] + np.radians(turned) * np.sign(speed))
        return _Motion(tuple(seconds), tuple(angles))

    def angle(self, time_s: Floats) -> Floats:
        """Joint angle [rad]."""
        return np.interp(time_s, self.knots_s, self.knots_rad)

    def way(self, time_s: Floats) -> Floats:
        """Sign of the speed."""
        piece = np.clip(np.searchsorted(self.knots_s, time_s, side="right") - 1, 0, len(self.knots_s) - 2)
        return np.sign(np.diff(self.knots_rad))[piece]


def random_room(rng: np.random.Generator) -> Room:
    """6 to 20 m by 5 to 14 m by 2.4 to 5 m, turned about the vertical by any angle, with six blocks in it."""
    yaw_deg = rng.uniform(0, 90)
    length, width, height = rng.uniform([6, 5, 2.4], [20, 14, 5])
    R = Rotation.from_euler("z", yaw_deg, degrees=True).as_matrix()
    blocks: list[Block] = []
    while len(blocks) < 6:
        size = rng.uniform([0.5, 0.5, 0.5], [2.5, 2.5, 2.2])
        at = rng.uniform([-length / 2, -width / 2], [length / 2, width / 2])
        if np.linalg.norm(at) > 2.2:  # the scanner stands near the middle
            x, y, _ = R @ [*at, 0.0]
            blocks.append(Block((float(x), float(y), size[2] / 2), tuple(size.tolist()), float(rng.uniform(0, 90))))
    walls = Block((0.0, 0.0, height / 2), (float(length), float(width), float(height)), float(yaw_deg))
    return Room(walls, tuple(blocks))


def random_mount(rng: np.random.Generator, kind: int, **setup: Any) -> Setup:
    """A set-up near the middle of a room: rolling, pitching, or any mount whose scan plane leans well on the axis."""
    if kind % 3 == 0:
        rot_deg, laser_deg = (0.0, 90.0), (0.0, -90.0)
    elif kind % 3 == 1:
        rot_deg, laser_deg = (-90.0, 0.0), (90.0, 0.0)
    else:
        rot_deg = tuple(rng.uniform([-180, -90], [180, 90]).tolist())
        laser_deg = (float(rng.uniform(35, 90)), float(rng.uniform(-60, 60)))
    position_m = tuple(rng.uniform([-1, -1, 0.6], [1, 1, 1.6]).tolist())
    return Setup(laser_deg=laser_deg, rot_deg=rot_deg, position_m=position_m, **setup)


def simulate(room: Room, setup: Setup, truth: Truth, seed: int = 0, unrest: Unrest = Unrest()) -> Simulated:
    """Scan a room with a faulty scanner."""
    rng = np.random.default_rng(seed)
    motion = _Motion.of(setup.sweeps)
    beams = _beams(setup, motion)
    origin, direction = _rays(setup, truth, motion, beams)
    origin = origin + np.multiply.outer(beams.time_s, unrest.velocity_m_s)
    range_m, _ = cast(room, origin, direction)
    range_m = np.minimum(range_m, _walkers(rng, room, setup, unrest, beams.time_s, origin, direction))
    range_m = range_m - truth.bias_m + rng.normal(0.0, setup.noise_m, range_m.size)
    range_m[range_m > room.range_max_m] = np.inf
    per_scan = range_m.reshape(-1, setup.beams).astype(np.float32)
    stamps = START_NS + np.rint(beams.time_s.reshape(-1, setup.beams)[:, 0] * 1e9).astype(np.int64)
    step_s = _beam_time_s(setup)
    scans = [
        Scan(
            stamp_ns=int(stamp),
            angle_min_rad=float(beams.bearing_rad[0]),
            angle_increment_rad=float(np.radians(setup.fov_deg) / (setup.beams - 1)),
            time_increment_s=step_s,
            scan_time_s=1 / setup.rate_hz,
            range_min_m=0.05,
            range_max_m=room.range_max_m,
            range_m=row,
            intensity=np.empty(0, np.float32),
        )
        for stamp, row in zip(stamps.tolist(), per_scan, strict=True)
    ]
    log_s = np.arange(-0.5, motion.knots_s[-1] + 0.5, 0.004)
    logged = motion.angle(log_s)
    if setup.step_deg:
        logged = np.radians(setup.step_deg) * np.rint(logged / np.radians(setup.step_deg))
    log_ns = START_NS + np.rint((log_s + truth.lag_s) * 1e9).astype(np.int64)
    return Simulated(scans, JointLog(log_ns, logged))


def walked(room: Room, setup: Setup, truth: Truth, seed: int, unrest: Unrest) -> tuple[int, int]:
    """How many beams of `simulate` met somebody, and near how many of these another look went on behind them.

    Near: within 1 deg. Another look: over 0.6 s away. Behind: by more than 0.25 m.
    """
    motion = _Motion.of(setup.sweeps)
    beams = _beams(setup, motion)
    origin, direction = _rays(setup, truth, motion, beams)
    range_m, _ = cast(room, origin, direction)
    person_m = _walkers(np.random.default_rng(seed), room, setup, unrest, beams.time_s, origin, direction)
    met = np.flatnonzero(person_m < range_m)
    on_m = np.where(person_m < range_m, -np.inf, range_m)
    near = cKDTree(direction).query_ball_point(direction[met], np.radians(1.0))
    behind = [
        bool(np.any((np.abs(beams.time_s[those] - beams.time_s[k]) > 0.6) & (on_m[those] > person_m[k] + 0.25)))
        for k, those in zip(met.tolist(), near, strict=True)
    ]
    return met.size, sum(behind)


def bound(room: Room, setup: Setup, truth: Truth, names: tuple[str, ...]) -> Floats:
    """Cramer-Rao bound of the named errors, estimated together, shape (k, k).

    Each plane of the room has three unknown numbers of its own; each beam's plane is known. Beams that graze a surface
    (beyond 84 deg) do not count: a few dozen of them, on a box seen edge-on, would halve the bound of one offset, and
    no beam is a line.
    """
    motion = _Motion.of(setup.sweeps)
    beams = _beams(setup, motion)
    origin, direction = _rays(setup, truth, motion, beams)
    range_m, face = cast(room, origin, direction)
    normal, offset = _planes(room)
    normal, offset = normal[face], offset[face]
    slant = np.sum(normal * direction, axis=1)
    seen = (range_m < room.range_max_m) & (np.abs(slant) > np.cos(np.radians(84.0)))

    def ranges(changed: Truth) -> Floats:
        o, d = _rays(setup, changed, motion, beams, changed.lag_s - truth.lag_s)
        return (offset - np.sum(normal * o, axis=1)) / np.sum(normal * d, axis=1) - changed.bias_m

    columns = []
    for name in names:
        h = 1e-5
        low, high = (replace(truth, **{name: getattr(truth, name) + s * h}) for s in (-1, 1))
        columns.append((ranges(high) - ranges(low)) / (2 * h))
    J = np.stack(columns, axis=1)[seen]
    # plane n.p = c, moved by n -> n + dn, c -> c + dc: the range changes by (dc - dn.p) / (n.d)
    hit = origin + range_m[:, None] * direction
    P = (np.column_stack([-hit, np.ones(hit.shape[0])]) / slant[:, None])[seen]
    face = face[seen]
    information = J.T @ J
    for k in np.unique(face):
        mine = face == k
        # four columns for three freedoms: the pseudo-inverse leaves the scale of (n, c) out
        across = P[mine].T @ J[mine]
        information -= across.T @ np.linalg.pinv(P[mine].T @ P[mine], hermitian=True, rcond=1e-10) @ across
    return setup.noise_m**2 * np.linalg.inv(information)


def faces(room: Room, setup: Setup, truth: Truth, time_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number of the surface that the beam of each time meets, as `cast` counts them, shape (n,)."""
    motion = _Motion.of(setup.sweeps)
    beams = _beams(setup, motion)
    fired_ns = START_NS + np.rint(beams.time_s * 1e9).astype(np.int64)
    _, face = cast(room, *_rays(setup, truth, motion, beams))
    nearest = np.searchsorted(fired_ns, time_ns - 1000)  # stamps and steps are rounded
    return face[nearest]


def cast(room: Room, origin: Floats, direction: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """Range to the first surface and its number (six to a block, the walls first), each shape (n,)."""
    best, face = _through(room.walls, origin, direction, inside=True)
    for k, block in enumerate(room.blocks, 1):
        range_m, its = _through(block, origin, direction, inside=False)
        nearer = range_m < best
        best, face = np.where(nearer, range_m, best), np.where(nearer, 6 * k + its, face)
    return best, face


def _walkers(
    rng: np.random.Generator,
    room: Room,
    setup: Setup,
    unrest: Unrest,
    time_s: Floats,
    origin: Floats,
    direction: Floats,
) -> Floats:
    """Range to the nearest of those who walk, shape (n,)."""
    people = [_walker(rng, room, setup, time_s, origin, direction) for _ in range(unrest.walkers)]
    return np.min([*people, np.full(time_s.size, np.inf)], axis=0)


def _walker(
    rng: np.random.Generator, room: Room, setup: Setup, time_s: Floats, origin: Floats, direction: Floats
) -> Floats:
    """Range to somebody who walks to and fro at 1 m/s, 1.5 m from the scanner or more, shape (n,)."""
    R = Rotation.from_euler("z", room.walls.yaw_deg, degrees=True).as_matrix()
    x, y = np.array(room.walls.size_m[:2]) / 2 - 0.5
    aside = rng.choice([-1, 1]) * rng.uniform(1.5, max(y, 1.6))
    along = x * (2 * np.abs((time_s / (2 * x) + rng.random()) % 2 - 1) - 1)
    at = np.column_stack([along, np.full(time_s.size, aside), np.full(time_s.size, 0.85)]) @ R.T
    here = np.array([setup.position_m[0], setup.position_m[1], 0.0])
    person = Block((0.0, 0.0, 0.0), (0.35, 0.5, 1.7), room.walls.yaw_deg)
    return _through(person, origin - at - here, direction, inside=False)[0]


def _through(block: Block, origin: Floats, direction: Floats, *, inside: bool) -> tuple[Floats, NDArray[np.int64]]:
    R = Rotation.from_euler("z", block.yaw_deg, degrees=True).as_matrix()
    o, d = (origin - block.centre_m) @ R, direction @ R
    half = np.array(block.size_m) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (-half - o) / d, (half - o) / d
    near, far = np.minimum(a, b), np.maximum(a, b)
    entry, leave = near.max(axis=1), far.min(axis=1)
    if inside:
        axis = far.argmin(axis=1)
        return leave, 2 * axis + (d[np.arange(axis.size), axis] > 0)
    axis = near.argmax(axis=1)
    range_m = np.where((entry < leave) & (entry > 0), entry, np.inf)
    return range_m, 2 * axis + (d[np.arange(axis.size), axis] < 0)


def _planes(room: Room) -> tuple[Floats, Floats]:
    """Normals and offsets of all faces, in the order of `cast`."""
    normals, offsets = [], []
    for block in (room.walls, *room.blocks):
        R = Rotation.from_euler("z", block.yaw_deg, degrees=True).as_matrix()
        for axis in range(3):
            for side in (-1, 1):
                normal = side * R[:, axis]
                normals.append(normal)
                offsets.append(normal @ block.centre_m + block.size_m[axis] / 2)
    return np.array(normals), np.array(offsets)


def _beam_time_s(setup: Setup) -> float:
    return setup.fov_deg / 360 / setup.rate_hz / setup.beams


def _beams(setup: Setup, motion: _Motion) -> _Beams:
    scans = round(motion.knots_s[-1] * setup.rate_hz)
    half = np.radians(setup.fov_deg) / 2
    bearing = np.linspace(-half, half, setup.beams)
    time = np.add.outer(np.arange(scans) / setup.rate_hz, np.arange(setup.beams) * _beam_time_s(setup))
    return _Beams(time.ravel(), np.tile(bearing, scans))


def _rays(setup: Setup, truth: Truth, motion: _Motion, beams: _Beams, late_s: float = 0.0) -> tuple[Floats, Floats]:
    """Origins and directions in the world, each shape (n, 3), as if the joint were `late_s` ahead."""
    joint = motion.angle(beams.time_s + late_s)
    one, two = joint, 2 * joint
    axis = joint + truth.cos1_rad * np.cos(one) + truth.sin1_rad * np.sin(one)
    axis = axis + truth.cos2_rad * np.cos(two) + truth.sin2_rad * np.sin(two)
    axis = axis - motion.way(beams.time_s) * truth.backlash_rad / 2
    laser = Rotation.from_euler("xy", setup.laser_deg, degrees=True)
    laser = Rotation.from_rotvec([truth.tilt_x_rad, truth.tilt_y_rad, 0.0]) * laser
    in_plane = np.column_stack([np.cos(beams.bearing_rad), np.sin(beams.bearing_rad), np.zeros(beams.bearing_rad.size)])
    world = Rotation.from_euler("XY", setup.rot_deg, degrees=True)
    turn = world * Rotation.from_euler("z", axis[:, None])
    offset = np.array([truth.offset_x_m, truth.offset_y_m, 0.0])
    return turn.apply(offset) + np.array(setup.position_m), turn.apply(laser.apply(in_plane))


def write(path: Path, made: Simulated) -> Path:
    """Write a recording, its messages in the order of their times."""
    stamps = np.concatenate([made.log.time_ns, [scan.stamp_ns for scan in made.scans]])
    joints = made.log.time_ns.size
    with recording_writer(path, {"source": "simulated"}) as writer:
        for k in np.argsort(stamps, kind="stable").tolist():
            if k < joints:
                writer.joint(int(made.log.time_ns[k]), float(made.log.position_rad[k]))
            else:
                writer.scan(made.scans[k - joints])
    return path

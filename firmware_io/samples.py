"""Measurements: scans of the lidar, and the log of the servo's angle.

Times are integer nanoseconds of one clock; angles are radians, ranges metres. A beam keeps its index from the sensor to
the cloud.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32, Float64, Int64
from numpy import ndarray

from scanwright.design.arrays import Float32s, Ints
from scanwright.design.errors import RecordingError

_TURNS_RAD = 1000.0
_SCAN_BOUNDS = (
    ("angle_min_rad", -_TURNS_RAD, _TURNS_RAD),
    ("angle_increment_rad", -_TURNS_RAD, _TURNS_RAD),
    ("time_increment_s", 0.0, 1.0),
    ("range_min_m", -math.inf, math.inf),
    ("range_max_m", -math.inf, math.inf),
)
_LONGEST_TURN_NS = 2**32 - 1
_MOST_RAD = 1e9  # of a joint that counts turns, for years


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scan:
    """One turn of the 2D lidar, with the fields of a LaserScan. Invalid values raise RecordingError.

    A scan of a sensor with varying speed has `beam_bearing_rad` and `beam_offset_ns`, both or none; the fields of the
    LaserScan are then the nearest even grid.
    """

    stamp_ns: int  # time of the first beam
    angle_min_rad: float  # bearing of the first beam, counter-clockwise from the laser's x
    angle_increment_rad: float  # between two beams; negative for a lidar that turns clockwise
    time_increment_s: float  # between two beams; 0 if unknown
    scan_time_s: float  # of a turn of the mirror, also if turns between two scans are skipped; 0 if unknown
    range_min_m: float  # shortest valid range
    range_max_m: float  # longest valid range
    range_m: Float32[ndarray, " n"]  # as sent by the sensor; NaN, inf or 0 without a return
    intensity: Float32[ndarray, " m"]  # shape (n,), or (0,) from a sensor that measures none
    beam_bearing_rad: Float64[ndarray, " k"] | None = None  # of each beam, shape (n,); None on the even grid
    beam_offset_ns: Int64[ndarray, " t"] | None = None  # of each beam after the stamp, not decreasing, shape (n,)

    def __post_init__(self) -> None:
        for name, low, high in _SCAN_BOUNDS:
            if not low <= (value := getattr(self, name)) <= high:
                raise RecordingError(f"scans: {name} = {value}: {low:g} to {high:g}")
        if self.beam_bearing_rad is not None or self.beam_offset_ns is not None:
            self._check_beams(self.beam_bearing_rad, self.beam_offset_ns)

    def _check_beams(self, bearing_rad: Float64[ndarray, " k"] | None, offset_ns: Int64[ndarray, " t"] | None) -> None:
        if bearing_rad is None or offset_ns is None or not bearing_rad.shape == offset_ns.shape == self.range_m.shape:
            raise RecordingError(f"scans: {self.range_m.size} ranges, and not as many bearings and times of beams")
        if not (np.abs(bearing_rad) <= _TURNS_RAD).all():
            raise RecordingError(f"scans: the bearing of a beam is no number, or beyond {_TURNS_RAD:g} rad")
        if offset_ns.size and not (offset_ns[0] >= 0 and (np.diff(offset_ns) >= 0).all()):
            raise RecordingError("scans: the time of a beam is before that of the one before it")
        if offset_ns.size and offset_ns[-1] > _LONGEST_TURN_NS:
            raise RecordingError(f"scans: a turn of {offset_ns[-1] / 1e9:.1f} s: at most {_LONGEST_TURN_NS / 1e9:g}")

    @property
    def bearing_rad(self) -> Float64[ndarray, " beams"]:
        """Bearing of each beam in the scan plane, shape (n,)."""
        if self.beam_bearing_rad is not None:
            return self.beam_bearing_rad
        return self.angle_min_rad + self.angle_increment_rad * np.arange(self.range_m.size, dtype=np.float64)

    @property
    def time_ns(self) -> Int64[ndarray, " beams"]:
        """Time of each beam, shape (n,)."""
        if self.beam_offset_ns is not None:
            return self.stamp_ns + self.beam_offset_ns
        offset_ns = np.rint(np.arange(self.range_m.size) * (self.time_increment_s * 1e9))
        return self.stamp_ns + offset_ns.astype(np.int64)


def chosen_echo(range_m: Float32s, intensity: Float32s, echo: str) -> Ints:
    """Return the index of an echo of each ray, shape (...); of "all" the first, of equal intensities the nearest.

    Args:
        range_m: shape (..., echoes), NaN, inf or 0 if there is none.
        intensity: shape (..., echoes), or without echoes (..., 0).
        echo: first, last, strongest or all.
    """
    returned = np.isfinite(range_m) & (range_m > 0)
    near_m = np.where(returned, range_m, np.inf)
    if echo == "last":
        return np.argmax(np.where(returned, range_m, -np.inf), axis=-1)
    if echo == "strongest" and intensity.shape == range_m.shape:
        lit = np.where(returned, intensity, -np.inf)
        near_m = np.where(lit == lit.max(axis=-1, keepdims=True), near_m, np.inf)
    return np.argmin(near_m, axis=-1)


def with_all_echoes(scan: Scan, range_m: Float32s, intensity: Float32s, echoes: int) -> Scan:
    """Return a scan with all echoes of its rays as separate beams, with the bearing and time of their ray.

    Args:
        scan: of one echo.
        range_m: shape (rays, m).
        intensity: shape (rays, m).
        echoes: of each ray, at least m; missing ones are inf.
    """
    rays = len(range_m)
    missing = ((0, 0), (0, echoes - range_m.shape[1]))
    range_m, intensity = np.pad(range_m, missing, constant_values=np.inf), np.pad(intensity, missing)
    last = max(rays * echoes - 1, 1)
    return replace(
        scan,
        angle_increment_rad=scan.angle_increment_rad * (rays - 1) / last,
        time_increment_s=scan.time_increment_s * (rays - 1) / last,
        range_m=range_m.ravel(),
        intensity=intensity.ravel() if scan.intensity.size else scan.intensity,
        beam_bearing_rad=np.repeat(scan.bearing_rad, echoes),
        beam_offset_ns=np.repeat(scan.time_ns - scan.stamp_ns, echoes),
    )


def echo_count(scan: Scan) -> int:
    """Return the number of consecutive beams with one bearing: the echoes of a ray."""
    if scan.beam_bearing_rad is None or scan.beam_offset_ns is None:
        return 1
    changes = np.flatnonzero(np.diff(scan.beam_bearing_rad) != 0) + 1
    echoes = int(changes[0]) if changes.size else 1
    return echoes if np.array_equal(changes, np.arange(echoes, scan.range_m.size, echoes)) else 1


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Consecutive scans that differ only in time and measurement; rows are scans, columns beams."""

    first: Scan  # with the common fields
    stamp_ns: Int64[ndarray, " scans"]  # time of the first beam of each scan, shape (s,)
    range_m: Float32[ndarray, "scans beams"]  # shape (s, n)
    intensity: Float32[ndarray, "scans m"]  # shape (s, n), or (s, 0) if the sensor measures none


def blocks(scans: Iterable[Scan], most: int = 256) -> Iterator[Block]:
    """Group consecutive scans to blocks of at most `most`; one with `beam_bearing_rad` is a separate block."""
    waiting: list[Scan] = []
    for scan in scans:
        if waiting and (len(waiting) == most or _shape(scan) != _shape(waiting[0])):
            yield _block(waiting)
            waiting = []
        waiting.append(scan)
    if waiting:
        yield _block(waiting)


def _shape(scan: Scan) -> tuple[float, ...]:
    return (
        0 if scan.beam_bearing_rad is None else id(scan),
        scan.range_m.size,
        scan.intensity.size,
        scan.angle_min_rad,
        scan.angle_increment_rad,
        scan.time_increment_s,
        scan.range_min_m,
        scan.range_max_m,
    )


def _block(scans: list[Scan]) -> Block:
    return Block(
        first=scans[0],
        stamp_ns=np.array([scan.stamp_ns for scan in scans], np.int64),
        range_m=np.stack([scan.range_m for scan in scans]),
        intensity=np.stack([scan.intensity for scan in scans]),
    )


@dataclass(frozen=True, slots=True)
class JointSample:
    """One angle of the servo [rad], unwrapped (it counts turns)."""

    time_ns: int
    position_rad: float


@dataclass(frozen=True, slots=True)
class PoseSample:
    """Pose of the platform at one time: the `world` frame on the map."""

    time_ns: int  # on the clock of the scans
    position_m: tuple[float, float, float]  # x y z
    quaternion: tuple[float, float, float, float]  # x y z w


@dataclass(frozen=True, slots=True, eq=False)
class JointLog:
    """Servo angles over time."""

    time_ns: Int64[ndarray, " n"]  # strictly increasing
    position_rad: Float64[ndarray, " m"]  # shape (n,), unwrapped (it counts turns), finite

    def __post_init__(self) -> None:
        if self.time_ns.shape != self.position_rad.shape or self.time_ns.ndim != 1 or not self.time_ns.size:
            raise RecordingError(f"joint log: {self.time_ns.size} times and {self.position_rad.size} positions")
        if not (np.abs(self.position_rad) <= _MOST_RAD).all():
            raise RecordingError(f"joint log: a position is not a finite number, or beyond {_MOST_RAD:g} rad")
        if np.any(np.diff(self.time_ns) <= 0):
            number = int(np.argmax(np.diff(self.time_ns) <= 0)) + 1
            raise RecordingError(f"joint log: sample {number} is not later than the one before it")

    def angle_at(self, time_ns: Int64[ndarray, " *k"]) -> Float64[ndarray, " *k"]:
        """Return the angle [rad] at each time by linear interpolation, in its shape; NaN outside the log."""
        if not time_ns.size:
            return np.empty(0)
        first, last = np.searchsorted(self.time_ns, [time_ns.min(), time_ns.max()])
        near = slice(max(int(first) - 1, 0), int(last) + 1)
        if not self.time_ns[near].size:
            return np.full(time_ns.size, np.nan)
        # float64 rounds nanoseconds since 1970 to 256 ns, but not differences
        origin_ns = self.time_ns[near][0]
        known_ns = (self.time_ns[near] - origin_ns).astype(float)
        since_ns = (time_ns - origin_ns).astype(float)
        return np.interp(since_ns, known_ns, self.position_rad[near], left=np.nan, right=np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class AxisCurve:
    """Servo angle as a piecewise cubic of time."""

    knot_ns: Int64[ndarray, " knots"]  # begin of each piece, and end of the last one, shape (k + 1,), increasing
    coefficient: Float64[ndarray, "pieces 4"]  # angle [rad] = sum_j coefficient[i, j] s^j, s seconds into piece i

    def angle_at(self, time_ns: Int64[ndarray, " *k"]) -> Float64[ndarray, " *k"]:
        """Return the angle [rad] at each time, shape (n,); NaN outside the curve."""
        piece = np.searchsorted(self.knot_ns, time_ns, side="right") - 1
        inside = (piece >= 0) & (time_ns <= self.knot_ns[-1])
        piece = piece.clip(0, len(self.coefficient) - 1)
        seconds = (time_ns - self.knot_ns[piece]) / 1e9
        c0, c1, c2, c3 = self.coefficient[piece].T
        return np.where(inside, c0 + seconds * (c1 + seconds * (c2 + seconds * c3)), np.nan)


def straight(log: JointLog) -> AxisCurve:
    """Return the curve of linear interpolation of a log."""
    time_ns, position_rad = log.time_ns, log.position_rad
    if time_ns.size == 1:
        return AxisCurve(np.repeat(time_ns, 2), np.array([[position_rad[0], 0.0, 0.0, 0.0]]))
    slope = np.diff(position_rad) / (np.diff(time_ns) / 1e9)
    none = np.zeros_like(slope)
    return AxisCurve(time_ns, np.stack([position_rad[:-1], slope, none, none], axis=1))

"""What the two devices said: one scan of the lidar, and the log of the servo's angle.

Times are integer nanoseconds of one clock; angles are radians, ranges metres. A beam keeps its index from the
sensor to the cloud: nothing here removes one.
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
_MOST_RAD = 1e9  # of a joint that counts turns: years of them


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scan:
    """One turn of the 2D lidar, as a LaserScan holds it.

    A sensor whose speed wanders has beams of its own in each turn: `beam_bearing_rad` and `beam_offset_ns`, both or
    none. What a LaserScan would hold then is the even grid that is nearest to them.

    Attributes:
        stamp_ns: time of the first beam.
        angle_min_rad: bearing of the first beam, counter-clockwise from the laser's x.
        angle_increment_rad: from one beam to the next; negative for a lidar that turns clockwise.
        time_increment_s: from one beam to the next; 0 where the sensor does not say.
        scan_time_s: of a turn of the mirror, also if turns between two scans are skipped; 0 if unknown.
        range_min_m: shortest range the sensor can mean.
        range_max_m: longest range the sensor can mean.
        range_m: shape (n,), as the sensor gave it; NaN, inf or 0 where nothing returned.
        intensity: shape (n,), or (0,) from a sensor that measures none.
        beam_bearing_rad: bearing of each beam, shape (n,); None on the even grid.
        beam_offset_ns: time of each beam after the stamp, not decreasing, shape (n,); None on the even grid.

    Raises:
        RecordingError: bearings, times between beams or limits of the range are no numbers of a lidar.
    """

    stamp_ns: int
    angle_min_rad: float
    angle_increment_rad: float
    time_increment_s: float
    scan_time_s: float
    range_min_m: float
    range_max_m: float
    range_m: Float32[ndarray, " n"]
    intensity: Float32[ndarray, " m"]
    beam_bearing_rad: Float64[ndarray, " k"] | None = None  # as many as ranges, or `__post_init__` says so
    beam_offset_ns: Int64[ndarray, " t"] | None = None

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
    """Return a scan with every echo of its rays as a beam of its own.

    Beams of one ray have its bearing and time, by which `echo_count` recognises them.

    Args:
        scan: of one echo.
        range_m: shape (rays, m).
        intensity: shape (rays, m).
        echoes: of each ray, at least m; those that are missing are inf.
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
    """Return how many beams in a row have one bearing and time: the echoes of a ray."""
    if scan.beam_bearing_rad is None or scan.beam_offset_ns is None:
        return 1
    changes = np.flatnonzero(np.diff(scan.beam_bearing_rad) != 0) + 1
    echoes = int(changes[0]) if changes.size else 1
    return echoes if np.array_equal(changes, np.arange(echoes, scan.range_m.size, echoes)) else 1


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Consecutive scans that differ only in time and in what they measured; rows are scans, columns beams."""

    first: Scan  # the first of them, for what they share
    stamp_ns: Int64[ndarray, " scans"]  # time of the first beam of each scan, shape (s,)
    range_m: Float32[ndarray, "scans beams"]  # shape (s, n)
    intensity: Float32[ndarray, "scans m"]  # shape (s, n), or (s, 0) where the sensor measures none


def blocks(scans: Iterable[Scan], most: int = 256) -> Iterator[Block]:
    """Scans in their order, up to `most` of them at once; one with beams of its own is a block of its own."""
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
    """Where the platform was at one time: the `world` frame on the map."""

    time_ns: int  # since 1970, or on whatever clock the scans are
    position_m: tuple[float, float, float]  # x y z
    quaternion: tuple[float, float, float, float]  # x y z w


@dataclass(frozen=True, slots=True, eq=False)
class JointLog:
    """Servo angles over time.

    Attributes:
        time_ns: shape (m,), strictly increasing.
        position_rad: shape (m,), unwrapped (it counts turns), finite.
    """

    time_ns: Int64[ndarray, " n"]
    position_rad: Float64[ndarray, " m"]  # as many as times, or `__post_init__` says so

    def __post_init__(self) -> None:
        if self.time_ns.shape != self.position_rad.shape or self.time_ns.ndim != 1 or not self.time_ns.size:
            raise RecordingError(f"joint log: {self.time_ns.size} times and {self.position_rad.size} positions")
        if not (np.abs(self.position_rad) <= _MOST_RAD).all():
            raise RecordingError(f"joint log: a position is not a finite number, or beyond {_MOST_RAD:g} rad")
        if np.any(np.diff(self.time_ns) <= 0):
            where = int(np.argmax(np.diff(self.time_ns) <= 0)) + 1
            raise RecordingError(f"joint log: sample {where} is not later than the one before it")

    def angle_at(self, time_ns: Int64[ndarray, " *k"]) -> Float64[ndarray, " *k"]:
        """Angle [rad] at each time, straight between samples, shape (n,).

        Outside the log it is NaN: where the axis was before the first and after the last sample is unknown.
        """
        if not time_ns.size:
            return np.empty(0)
        first, last = np.searchsorted(self.time_ns, [time_ns.min(), time_ns.max()])
        near = slice(max(int(first) - 1, 0), int(last) + 1)
        if not self.time_ns[near].size:
            return np.full(time_ns.size, np.nan)
        # Epoch nanoseconds do not fit a float64 (they lose 256 ns), differences do.
        origin_ns = self.time_ns[near][0]
        known_ns = (self.time_ns[near] - origin_ns).astype(float)
        since_ns = (time_ns - origin_ns).astype(float)
        return np.interp(since_ns, known_ns, self.position_rad[near], left=np.nan, right=np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class AxisCurve:
    """Servo angle as a piecewise cubic of time.

    Attributes:
        coefficient: shape (k, 4); in piece i the angle [rad] is sum_j coefficient[i, j] s^j, s seconds into the piece.
    """

    knot_ns: Int64[ndarray, " knots"]  # where the pieces begin, and where the last one ends, shape (k + 1,), increasing
    coefficient: Float64[ndarray, "pieces 4"]

    def angle_at(self, time_ns: Int64[ndarray, " *k"]) -> Float64[ndarray, " *k"]:
        """Angle [rad] at each time, shape (n,); NaN outside the curve."""
        piece = np.searchsorted(self.knot_ns, time_ns, side="right") - 1
        inside = (piece >= 0) & (time_ns <= self.knot_ns[-1])
        piece = piece.clip(0, len(self.coefficient) - 1)
        seconds = (time_ns - self.knot_ns[piece]) / 1e9
        c0, c1, c2, c3 = self.coefficient[piece].T
        return np.where(inside, c0 + seconds * (c1 + seconds * (c2 + seconds * c3)), np.nan)


def straight(log: JointLog) -> AxisCurve:
    """The log as a curve, straight between its samples."""
    time_ns, position_rad = log.time_ns, log.position_rad
    if time_ns.size == 1:
        return AxisCurve(np.repeat(time_ns, 2), np.array([[position_rad[0], 0.0, 0.0, 0.0]]))
    slope = np.diff(position_rad) / (np.diff(time_ns) / 1e9)
    none = np.zeros_like(slope)
    return AxisCurve(time_ns, np.stack([position_rad[:-1], slope, none, none], axis=1))

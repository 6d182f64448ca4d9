"""Assembly of a stream of scans, angles and poses.

    assembler = Assembler(load_angles(Path("angles.json")))
    for message in robot:
        for line in assembler.push(message):
            show(line.points_m)

The kernel is that of `assemble`. A scan waits for an angle `latency_s` after its last beam, and for its pose if the
platform moves. Without smoothing (`smooth=False`, as for an axis at rest during each scan) the points are identical to
those of `assemble`; with smoothing, the angles are noisier than those of an entire recording. Their stated rms error is
up to a fifth too small near the end of a spline: `python -m benchmarks.firmware_io.streaming` prints both.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, UInt8
from numpy import ndarray

from scanwright.design.angles import AngleSet
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.axis_window import HISTORY_NS, AxisWindow, NewestValues
from scanwright.firmware_io.assembly.deskew_kernel import place_block
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.poses.trajectory import Trajectory, trajectory_of
from scanwright.firmware_io.samples import JointSample, PoseSample, Scan, blocks

LOOK_AHEAD_S = 0.35
MOST_WAITING = 400  # scans, ten seconds of the fastest sensors
_MOST_POSES = 20_000  # 100 Hz for 200 s
_LONGEST_S = 10.0  # delay and look-ahead, to bound the memory
_MOST_RAD = 1e9  # years of turns
_NORM_ERROR = 1e-2  # a quaternion printed with three digits is as well normalised
_NO_POSES = Trajectory(np.array([-(2**62), -(2**62) + 1]), np.zeros((2, 3)), np.array([[0.0, 0.0, 0.0, 1.0]] * 2))


@dataclass(frozen=True, slots=True, eq=False)
class ScanPoints:
    """One scan in the world, or on the map of the poses; row i is beam i."""

    scan: Scan
    points_m: Float32[ndarray, "n 3"]  # NaN if the verdict is not POINT
    joint_rad: Float64[ndarray, " n"]  # servo angle of each beam, NaN if unknown
    verdict: UInt8[ndarray, " n"]  # a `Verdict` for each beam
    axis_error_rad: float  # rms error of the angles; NaN with linear interpolation


class Assembler:
    """Places scans one by one, in constant memory.

    Samples and poses must be in the order of their times; each scan is returned once, in the order of input. If more
    than `MOST_WAITING` scans wait, the first one is returned with NaN for unknown points.

    Attributes:
        latency_s: time after the last beam of a scan until which angles are required.
        left_out: rejected samples and poses, reason -> count.
    """

    def __init__(
        self,
        angles: AngleSet,
        *,
        lag_s: float = 0.0,
        own_body: OwnBody | None = None,
        smooth: bool = True,
        look_ahead_s: float = LOOK_AHEAD_S,
        with_poses: bool = False,
    ) -> None:
        """Start without scans.

        Args:
            angles: angle set of the scanner.
            lag_s: delay of the servo's stamps: the beam of time t has the angle of t + lag_s.
            own_body: self-occlusion mask.
            smooth: smooth the steps of the encoder if that helps; False for a servo at rest during each scan.
            look_ahead_s: duration of the samples after a beam; longer is more accurate, and later.
            with_poses: whether the platform moves, and its poses are pushed too.

        Raises:
            RecordingError: a time is longer than ten seconds.
        """
        for name, value, least in (("lag_s", lag_s, -_LONGEST_S), ("look_ahead_s", look_ahead_s, 0.0)):
            if not least <= value <= _LONGEST_S:
                raise RecordingError(f"{name} = {value}: {least:g} to {_LONGEST_S:g}")
        self.latency_s = look_ahead_s if smooth else 0.0
        self.left_out: Counter[str] = Counter()
        self._angles, self._own_body = angles, own_body
        self._lag_s, self._lag_ns = lag_s, round(lag_s * 1e9)
        self._behind_ns = self._lag_ns + round(self.latency_s * 1e9)
        self._axis = AxisWindow(self.latency_s)
        self._poses = NewestValues(_MOST_POSES) if with_poses else None
        self._waiting: deque[Scan] = deque()

    def push(self, what: Scan | JointSample | PoseSample) -> list[ScanPoints]:
        """Add one message, and return the scans that can be placed now."""
        if isinstance(what, Scan):
            self._waiting.append(what)
        elif isinstance(what, JointSample):
            self._add_angle(what)
        else:
            self._add_pose(what)
        ready = [self._waiting.popleft() for _ in range(self._ready())]
        placed = self._placed(ready)
        self._forget()
        return placed

    def finish(self) -> list[ScanPoints]:
        """Return the waiting scans, with NaN for unknown points."""
        ready = list(self._waiting)
        self._waiting.clear()
        return self._placed(ready)

    def _add_angle(self, sample: JointSample) -> None:
        if not abs(sample.position_rad) <= _MOST_RAD:
            self.left_out["angles that are no number of an axis"] += 1
        elif sample.time_ns <= self._axis.last_ns:
            self.left_out["angles not later than the one before"] += 1
        else:
            self._axis.add(sample.time_ns, sample.position_rad)

    def _add_pose(self, sample: PoseSample) -> None:
        if self._poses is None:
            raise RecordingError("a pose for an assembler that was made without with_poses")
        numbers = (*sample.position_m, *sample.quaternion)
        if not all(map(math.isfinite, numbers)) or abs(math.hypot(*sample.quaternion) - 1) > _NORM_ERROR:
            self.left_out["poses that are none"] += 1
        elif sample.time_ns <= self._poses.last_ns:
            self.left_out["poses not later than the one before"] += 1
        else:
            self._poses.add(sample.time_ns, numbers)

    def _ready(self) -> int:
        """Return the number of waiting scans that can be placed."""
        late = max(len(self._waiting) - MOST_WAITING, 0)
        for count, scan in enumerate(self._waiting):
            end_ns = _end_ns(scan)
            known = end_ns + self._behind_ns <= self._axis.last_ns
            if not (known and (self._poses is None or end_ns <= self._poses.last_ns)):
                return max(count, late)
        return len(self._waiting)

    def _placed(self, ready: list[Scan]) -> list[ScanPoints]:
        out: list[ScanPoints] = []
        remaining = iter(ready)
        for block in blocks(ready):
            first_ns = int(block.stamp_ns.min())
            last_ns = int(block.stamp_ns.max()) + _end_ns(block.first) - block.first.stamp_ns
            curve, error_rad = self._axis.curve(first_ns + self._lag_ns, last_ns + self._lag_ns)
            placed = place_block(
                block,
                curve,
                self._angles,
                self._lag_s,
                poses=self._trajectory(first_ns, last_ns),
                own_body=self._own_body,
            )
            rows = zip(placed.points_m, placed.joint_rad, placed.verdict, strict=True)
            out += [ScanPoints(next(remaining), *row, error_rad) for row in rows]
        return out

    def _trajectory(self, first_ns: int, last_ns: int) -> Trajectory | None:
        """Return the poses around these times, `_NO_POSES` of fewer than two; None for a platform at rest."""
        if self._poses is None:
            return None
        time_ns, numbers = self._poses.around(first_ns, last_ns)
        return trajectory_of(time_ns, numbers) if len(time_ns) > 1 else _NO_POSES

    def _forget(self) -> None:
        """Drop the samples and poses before all waiting and future scans."""
        oldest_ns = min((scan.stamp_ns for scan in self._waiting), default=2**62)
        behind_ns = min(self._axis.last_ns - HISTORY_NS, oldest_ns)
        self._axis.forget(behind_ns + min(self._lag_ns, 0))
        if self._poses is not None:
            self._poses.forget(min(self._poses.last_ns - HISTORY_NS, oldest_ns))


def _end_ns(scan: Scan) -> int:
    """Return the time of the last beam, as in `Scan.time_ns`."""
    if scan.beam_offset_ns is not None:
        return scan.stamp_ns + (int(scan.beam_offset_ns[-1]) if scan.beam_offset_ns.size else 0)
    return scan.stamp_ns + round(max(scan.range_m.size - 1, 0) * (scan.time_increment_s * 1e9))

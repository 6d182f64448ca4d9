"""`scanwright assemble`: recording and angle set become a point cloud in the world.

A beam fired at time t with range r and bearing b lies at

    p_world = T_world_laser(joint(t + lag)) @ [r cos b, r sin b, 0, 1]

each beam at its own servo angle (de-skew). The joint turns about the z of the rotation frame, so that
`T_world_laser(g) = T_world_rot(0) Rz(g) T_rot_laser`: per beam it takes one sine, one cosine and two constant
rotations, and no 4x4 matrix.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from design import frames
from design.angles import AngleSet
from design.errors import RecordingError
from firmware_io.cloud import PlyWriter
from firmware_io.recording import Recording, open_recording
from firmware_io.samples import Floats, JointLog, Scan, Times


class Verdict(IntEnum):
    """Why a beam became no point, or that it did. A beam has the first that applies, from top to bottom."""

    POINT = 0
    NO_RETURN = 1  # NaN, +inf (REP 117), or the 0 of drivers that know neither
    TOO_NEAR = 2  # below range_min, or -inf (REP 117)
    TOO_FAR = 3  # above range_max
    OUTSIDE_JOINT_LOG = 4


@dataclass(frozen=True, slots=True, eq=False)
class PlacedScan:
    """One scan in the world; row i is beam i.

    Attributes:
        scan: what was measured.
        time_ns: shape (n,).
        joint_rad: servo angle of each beam, shape (n,), NaN outside the joint log.
        verdict: a `Verdict` for each beam, shape (n,).
        points_m: shape (n, 3), NaN where the verdict is not POINT.
    """

    scan: Scan
    time_ns: Times
    joint_rad: Floats
    verdict: NDArray[np.uint8]
    points_m: Floats


@dataclass(frozen=True, slots=True)
class AssembleSummary:
    """What became of every beam: `beams == points + sum(left_out.values())`.

    Attributes:
        out: the cloud.
        points: beams with a place in the world.
        beams: beams in the recording.
        width: rows of the cloud per scan; 0 in a flat cloud.
        height: scans.
        padding: rows that fill up scans shorter than `width`.
        left_out: reason -> beams; NaN rows in an organised cloud, absent in a flat one.
    """

    out: Path
    points: int
    beams: int
    width: int
    height: int
    padding: int
    left_out: dict[str, int]


def deskew(scan: Scan, joint_log: JointLog, angles: AngleSet, lag_s: float = 0.0) -> Floats:
    """Points of one scan in the world [m], shape (n, 3), NaN where a beam has no place.

    `lag_s` is how late the joint log's stamps are: the beam of time t has the angle logged at t + lag_s.
    """
    return next(place([scan], joint_log, angles, lag_s)).points_m


def place(scans: Iterable[Scan], joint_log: JointLog, angles: AngleSet, lag_s: float = 0.0) -> Iterator[PlacedScan]:
    """Place scans in the world one by one; nothing of an earlier scan is kept. `lag_s` as in `deskew`."""
    T_world_rot, T_rot_laser = angles.T_world_rot(0.0), angles.T_rot_laser()
    lag_ns = round(lag_s * 1e9)
    for scan in scans:
        time_ns = scan.time_ns
        joint_rad = joint_log.angle_at(time_ns + lag_ns)
        verdict = judge(scan, joint_rad)
        bearing_rad = scan.bearing_rad
        range_m = np.where(verdict == Verdict.POINT, scan.range_m.astype(np.float64), np.nan)
        points_rot = (
            np.multiply.outer(range_m * np.cos(bearing_rad), T_rot_laser[:3, 0])
            + np.multiply.outer(range_m * np.sin(bearing_rad), T_rot_laser[:3, 1])
            + T_rot_laser[:3, 3]
        )
        cos, sin = np.cos(joint_rad), np.sin(joint_rad)
        x, y, z = points_rot.T
        turned = np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
        yield PlacedScan(scan, time_ns, joint_rad, verdict, frames.apply(T_world_rot, turned))


def judge(scan: Scan, joint_rad: Floats) -> NDArray[np.uint8]:
    """A `Verdict` for each beam, shape (n,)."""
    range_m = scan.range_m
    return np.select(
        [
            np.isnan(range_m) | np.isposinf(range_m) | (range_m == 0),
            range_m < np.float32(scan.range_min_m),
            range_m > np.float32(scan.range_max_m),
            np.isnan(joint_rad),
        ],
        [Verdict.NO_RETURN, Verdict.TOO_NEAR, Verdict.TOO_FAR, Verdict.OUTSIDE_JOINT_LOG],
        Verdict.POINT,
    ).astype(np.uint8)


def assemble_recording(
    recording: Path, angles: AngleSet, out: Path, *, flat: bool = False, lag_s: float = 0.0
) -> AssembleSummary:
    """Write the cloud of a recording, in constant memory whatever its length.

    Args:
        recording: MCAP recording.
        angles: angle set of the scanner that made it.
        out: the cloud, `.ply`: x y z [m], intensity if there is any, time_s since the first beam, joint_rad, ring
            (= beam index).
        flat: leave out rows without a point; the organised form keeps them as NaN, `width` rows to a scan.
        lag_s: as in `deskew`.

    Raises:
        RecordingError: the recording is unreadable, or no beam of it becomes a point. Nothing is written then.
    """
    if out.suffix != ".ply":
        raise RecordingError(f"{out}: clouds are written as PLY; name it {out.with_suffix('.ply').name}")
    if not np.isfinite(lag_s):
        raise RecordingError(f"lag {lag_s} s: not a finite number")
    source = open_recording(recording)
    width, height = (0, source.beams.size) if flat else (int(source.beams.max()), source.beams.size)
    fields = cloud_fields(source.has_intensity)
    counts: Counter[int] = Counter()
    with PlyWriter(out, fields, _comments(source, angles, width, lag_s)) as cloud:
        for placed in place(source.scans(), source.joint_log, angles, lag_s):
            counts.update(dict(enumerate(np.bincount(placed.verdict, minlength=len(Verdict)).tolist())))
            rows = _rows(placed, fields, source.start_ns)
            cloud.write(rows[placed.verdict == Verdict.POINT] if flat else _padded(rows, width))
        left_out = {reason.name.lower(): counts[reason] for reason in Verdict if reason and counts[reason]}
        if not counts[Verdict.POINT]:
            reasons = ", ".join(f"{count} {reason}" for reason, count in left_out.items())
            raise RecordingError(f"{recording}: none of the {source.beams.sum()} beams becomes a point: {reasons}")
    beams = int(source.beams.sum())
    padding = 0 if flat else width * height - beams
    return AssembleSummary(out, counts[Verdict.POINT], beams, width, height, padding, left_out)


def cloud_fields(has_intensity: bool) -> np.dtype[np.void]:
    """Columns of our clouds. A recording without intensities has no such column."""
    intensity = [("intensity", "<f4")] if has_intensity else []
    # joint_rad counts turns: after ten minutes float32 would be a hundredth of a degree coarse
    rest = [("time_s", "<f8"), ("joint_rad", "<f8"), ("ring", "<u4")]
    return np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), *intensity, *rest])


def _rows(placed: PlacedScan, fields: np.dtype[np.void], start_ns: int) -> NDArray[np.void]:
    rows = np.empty(placed.time_ns.size, fields)
    for column, name in enumerate("xyz"):
        rows[name] = placed.points_m[:, column]
    if "intensity" in (fields.names or ()):
        rows["intensity"] = placed.scan.intensity if placed.scan.intensity.size else np.nan
    rows["time_s"] = (placed.time_ns - start_ns) / 1e9
    rows["joint_rad"] = placed.joint_rad
    rows["ring"] = np.arange(rows.size)
    return rows


def _padded(rows: NDArray[np.void], width: int) -> NDArray[np.void]:
    if rows.size == width:
        return rows
    padding = np.zeros(width - rows.size, rows.dtype)
    for name in set(rows.dtype.names or ()) - {"ring"}:
        padding[name] = np.nan
    padding["ring"] = np.arange(rows.size, width)
    return np.concatenate([rows, padding])


def _comments(source: Recording, angles: AngleSet, width: int, lag_s: float) -> list[str]:
    organised = [f"width {width}", f"height {source.beams.size}"] if width else []
    return [
        *organised,
        f"task {angles.task}, angles from {angles.source}, frame world",
        "x y z in m, joint_rad in rad, ring is the beam",
        f"time_s 0 is {source.start_ns} ns",
        *([f"joint log taken as {lag_s} s late"] if lag_s else []),
    ]

"""`scanwright assemble`: recording and angle set become point clouds.

Chunks of the recording become blocks of scans, blocks become rows, rows are written. Only the joint log, the times of
the scans and the poses are in memory. `deskew_kernel` describes the position of a beam.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import groupby, islice
from operator import itemgetter
from pathlib import Path
from statistics import median_high

import numpy as np
from numpy.typing import NDArray

from scanwright.design.angles import AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.concurrency.ahead import ahead
from scanwright.design.errors import RecordingError, suggest
from scanwright.design.files.atomic_file import check_place
from scanwright.firmware_io.assembly.axis_curve import axis_curve
from scanwright.firmware_io.assembly.beam_outcome import Verdict, between_surfaces, other_echoes
from scanwright.firmware_io.assembly.cloud_rows import cloud_fields, cloud_rows
from scanwright.firmware_io.assembly.deskew_kernel import PlacedBlock, place_block
from scanwright.firmware_io.assembly.options import COLUMNS, DEFAULT, AssembleOptions, Per
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.assembly.turns import turn_starts
from scanwright.firmware_io.clouds.cloud import COLUMN_TYPES
from scanwright.firmware_io.clouds.ply import ply_writer
from scanwright.firmware_io.poses.trajectory import Trajectory
from scanwright.firmware_io.recording.recording import Recording, open_recording
from scanwright.firmware_io.samples import Block, Scan, straight

_PER_RAD = {"turn": 2 * math.pi, "half": math.pi}
_LONGEST_LAG_S = 3600.0
_RINGS = np.iinfo(COLUMN_TYPES["ring"]).max + 1
_LONG_GAP = 5.0  # times the median time between two scans, to warn of lost ones
_FIRST_SCANS = 10  # the widest of them is compared with the sensor
_STEP_ERROR = 0.02  # relative rounding error of a multiple of the sensor's step, as of clusters
_FLOAT32_LIMIT_M = 8192.0  # beyond, the resolution of float32 is 1 mm


@dataclass(frozen=True, slots=True)
class AssembleSummary:
    """Result of an assembly: `beams == points + sum(left_out.values())`.

    Attributes:
        out: the cloud, or the name after which several are numbered.
        clouds: written files.
        points: beams with a point.
        rows: of all files; `points` in flat clouds.
        beams: in the recording.
        width: rows per scan of an organised cloud; 0 of a flat one.
        height: scans.
        padding: rows of scans shorter than `width`.
        left_out: reason -> beams; NaN rows in an organised cloud, absent in a flat one.
        notes: one sentence each.
    """

    out: Path
    clouds: tuple[Path, ...]
    points: int
    rows: int
    beams: int
    width: int
    height: int
    padding: int
    left_out: dict[str, int]
    notes: tuple[str, ...]

    def lines(self) -> list[str]:
        """Format the result."""
        rows = f"wrote {self.points:,} points of {self.beams:,} beams"
        if self.width:
            rows = f"wrote {self.rows:,} rows ({self.points:,} points, {self.width:,} rows a scan)"
        target = f"{self.out}" if self.clouds == (self.out,) else f"{len(self.clouds)} clouds, {self.clouds[0]} and on"
        return [
            *self.notes,
            *(f"left out {count:,} beams: {reason.replace('_', ' ')}" for reason, count in self.left_out.items()),
            f"{rows} to {target}",
        ]


def assemble_recording(
    recording: Path,
    angles: AngleSet,
    out: Path,
    options: AssembleOptions = DEFAULT,
    *,
    platform: Trajectory | None = None,
    own_body: OwnBody | None = None,
) -> AssembleSummary:
    """Write the cloud of a recording, or one for each turn of the axis, in constant memory.

    Args:
        recording: MCAP recording.
        angles: angle set of its scanner.
        out: the cloud, `.ply` (`finish` converts it): x y z [m] and columns; several are `out_000.ply` and so on.
        options: poses, imu, camera, outliers, voxel_m and normals are not applied here. A beam of time t has the angle
            logged at t + lag_s; a scan belongs to the cloud of its first beam.
        platform: poses of the platform, for clouds on a map; None for a platform at rest.
        own_body: self-occlusion mask.

    Raises:
        RecordingError: the recording is unreadable, or none of its beams has a point; nothing is written.
    """
    columns, organised, lag_s, per = options.columns, options.organised, options.lag_s, options.per
    _check(out, lag_s, columns)
    source = open_recording(recording)
    if options.smooth:
        curve, notes = axis_curve(source.joint_log, at_rest=source.at_rest)
    else:
        curve, notes = straight(source.joint_log), "axis angle: straight between samples, as set"
    cloud_from_rows = _cloud_of(source, per, round(lag_s * 1e9))
    fields = cloud_fields(source.has_intensity, columns)
    if source.beams.max() > _RINGS:
        raise RecordingError(f"{recording}: a scan of {source.beams.max()} beams: a cloud numbers at most {_RINGS}")
    width = int(source.beams.max()) if organised else 0
    counts: Counter[int] = Counter()
    written = 0
    clouds: dict[Path, int] = {}  # number of scans of each

    def rows_of(block: Block) -> NDArray[np.void]:
        first, with_joint = block.first, "joint_rad" in columns
        near_m, far_m = max(first.range_min_m, options.min_range_m), min(first.range_max_m, options.max_range_m)
        block = replace(block, first=replace(first, range_min_m=near_m, range_max_m=far_m))
        placed = place_block(block, curve, angles, lag_s, poses=platform, own_body=own_body, with_joint=with_joint)
        if options.echo != "all":
            _drop(placed, other_echoes(block, options.echo), Verdict.OTHER_ECHO)
        if options.edges_deg is not None:
            _drop(placed, between_surfaces(block, options.edges_deg), Verdict.BETWEEN_SURFACES)
        counts.update(dict(enumerate(np.bincount(placed.verdict.ravel()).tolist())))
        rows = cloud_rows(block, placed, fields, source.start_ns, max(width, block.range_m.shape[1]))
        # ten times faster than a mask
        return rows if organised else rows.ravel().take(np.flatnonzero(placed.verdict == Verdict.POINT))

    for which, tagged in groupby(_by_cloud(source.blocks(), cloud_from_rows), key=itemgetter(0)):
        path = out if per == "recording" else out.with_name(f"{out.stem}_{which:03}{out.suffix}")
        scans = int(np.sum(cloud_from_rows == which))
        comments = _comments(source, angles, width, scans, lag_s, platform is not None)
        before = counts[Verdict.POINT]
        with ply_writer(path, fields, comments) as cloud:
            for _ in ahead(cloud.write, (rows_of(block) for _, block in tagged)):
                pass
            if not counts[Verdict.POINT] and which == cloud_from_rows[-1]:
                reasons = ", ".join(f"{count} {reason}" for reason, count in _left_out(counts).items())
                raise RecordingError(f"{recording}: none of the {source.beams.sum()} beams becomes a point: {reasons}")
        if counts[Verdict.POINT] == before:
            path.unlink()
        else:
            clouds[path] = scans
            written += cloud.rows
    beam_count = int(source.beams.sum())
    return AssembleSummary(
        out=out,
        clouds=tuple(clouds),
        points=counts[Verdict.POINT],
        rows=written,
        beams=beam_count,
        width=width,
        height=source.beams.size,
        padding=width * source.beams.size - beam_count if width else 0,
        left_out=_left_out(counts),
        notes=(
            notes,
            *about_sensor(source, angles.sensor),
            *(*_about_gaps(source), *_about_poses(platform), *_about_own_body(own_body, source)),
            *_about_slivers(clouds, per),
        ),
    )


def _drop(placed: PlacedBlock, which: NDArray[np.bool_], why: Verdict) -> None:
    dropped = (placed.verdict == Verdict.POINT) & which
    placed.verdict[dropped] = why
    placed.points_m[dropped] = np.nan


def _check(out: Path, lag_s: float, columns: Iterable[str]) -> None:
    check_place(out, RecordingError)
    if out.suffix != ".ply":
        raise RecordingError(f"{out}: clouds are written as PLY; name it {out.with_suffix('.ply').name}")
    if not abs(lag_s) <= _LONGEST_LAG_S:
        raise RecordingError(f"lag {lag_s} s: a number from {-_LONGEST_LAG_S:g} to {_LONGEST_LAG_S:g}")
    for name in columns:
        if name not in COLUMNS:
            raise RecordingError(f"column '{name}': not one of a cloud{suggest(name, COLUMNS)}")


def _cloud_of(source: Recording, per: Per, lag_ns: int) -> NDArray[np.int64]:
    """Return the number of the cloud of each scan, not decreasing, shape (scans,)."""
    if per == "recording":
        return np.zeros(source.stamp_ns.size, np.int64)
    logged_ns = source.stamp_ns + lag_ns
    starts_ns = turn_starts(source.joint_log, int(logged_ns[0]), _PER_RAD[per])
    return np.maximum.accumulate(np.searchsorted(starts_ns, logged_ns, side="right"))


def _by_cloud(blocks: Iterable[Block], cloud_from_rows: NDArray[np.int64]) -> Iterator[tuple[int, Block]]:
    """Split the blocks at the ends of clouds; yield the number of the cloud and the block."""
    at = 0
    for block in blocks:
        numbers = cloud_from_rows[at : at + len(block.stamp_ns)]
        at += numbers.size
        ends = [*(np.flatnonzero(np.diff(numbers)) + 1).tolist(), numbers.size]
        for a, b in zip([0, *ends[:-1]], ends, strict=True):
            part = replace(
                block, stamp_ns=block.stamp_ns[a:b], range_m=block.range_m[a:b], intensity=block.intensity[a:b]
            )
            yield int(numbers[a]), part


def _left_out(counts: Counter[int]) -> dict[str, int]:
    return {reason.name.lower(): counts[reason] for reason in Verdict if reason and counts[reason]}


def _extent_rad(scan: Scan) -> float:
    return float(np.ptp(scan.bearing_rad)) if scan.bearing_rad.size else 0.0


def about_sensor(source: Recording, sensor: str) -> Iterator[str]:
    """Warn of scans that are not of the sensor of the angle set, whose cloud would be distorted."""
    lidars = {name: lidar for name, lidar in load_catalogue().products.items() if isinstance(lidar, Lidar)}
    if sensor not in lidars:
        near, known = suggest(sensor, lidars), "; known: "
        near = near if known not in near else ""
        yield f"note: sensor '{sensor}' is no lidar of the catalogue{near}: its beams are not compared"
        return
    named = lidars[sensor]
    # a scan can be incomplete: packets are lost
    scan = max(islice(source.scans(), _FIRST_SCANS), key=_extent_rad)
    own_deg, scan_deg = np.degrees(named.bearings_rad()), np.degrees(np.sort(scan.bearing_rad))
    if scan_deg.size < 2:
        return
    step_deg, grid_deg = 360 / named.steps_per_turn, math.degrees(abs(scan.angle_increment_rad))
    if own_deg.size >= named.steps_per_turn - 1:  # drivers of 360 deg sensors use any grid, but without a gap
        other = np.ptp(scan_deg) < 0.9 * 360
    else:
        steps = grid_deg / step_deg
        beyond = scan_deg[0] < own_deg[0] - grid_deg or scan_deg[-1] > own_deg[-1] + grid_deg
        other = beyond or abs(steps - max(round(steps), 1)) > _STEP_ERROR * steps
    if other:
        yield (
            f"warning: the beams of the recording go from {scan_deg[0]:.4g} to {scan_deg[-1]:.4g} deg, "
            f"{grid_deg:.3g} deg apart, those of {sensor} from {own_deg[0]:.4g} to {own_deg[-1]:.4g} deg, "
            f"{step_deg:.3g} deg apart: use the angle set of the scanner that made it"
        )


def _about_gaps(source: Recording) -> Iterator[str]:
    """Warn of missing time, but not of scans dropped between two stops."""
    usual_s = float(np.median(np.diff(source.stamp_ns))) / 1e9 if source.stamp_ns.size > 1 else math.inf
    known_ns = np.union1d(source.stamp_ns, source.joint_log.time_ns) if source.at_rest else source.stamp_ns
    gap_s = np.diff(known_ns) / 1e9
    if long := int(np.sum(gap_s > _LONG_GAP * usual_s)):
        longest, at_s = gap_s.max(), (known_ns[gap_s.argmax()] - source.start_ns) / 1e9
        others = f", and {long - 1} more such gaps" if long > 1 else ""
        yield f"warning: {longest:.1f} s without a scan at {at_s:.1f} s (usually {usual_s:.3f} s apart){others}"


def _about_poses(poses: Trajectory | None) -> Iterator[str]:
    if poses is None:
        return
    alone = poses.measured or poses
    gap_s = np.diff(alone.time_ns) / 1e9
    error_m, error_rad = alone.error()
    off = "" if math.isnan(error_m) else f", going straight between them is off by {error_m * 1000:.2g} mm"
    off += f" and {math.degrees(error_rad):.2g} deg" if off and poses.measured is None else ""
    yield f"poses: {alone.time_ns.size:,}, usually {np.median(gap_s):.3g} s apart{off}{' at most' if off else ''}"
    if gap_s.max() > 10 * np.median(gap_s):
        yield f"warning: between two poses lie up to {gap_s.max():.2f} s: the platform goes straight across"
    if np.abs(poses.position_m).max() > _FLOAT32_LIMIT_M:
        far_km = np.abs(poses.position_m).max() / 1000
        yield f"warning: poses lie {far_km:.0f} km from 0, where float32 steps by 1 mm or more: subtract an offset"


def _about_own_body(own_body: OwnBody | None, source: Recording) -> Iterator[str]:
    if own_body is None:
        return
    bearing_rad = next(iter(source.scans())).bearing_rad
    if unknown := own_body.unknown(bearing_rad):
        yield f"warning: {unknown} of {bearing_rad.size} beams have no bearing in the own-body mask: not masked"


def _about_slivers(clouds: dict[Path, int], per: Per) -> Iterator[str]:
    """Warn of incomplete clouds at the ends of the recording, which are too small to register."""
    usual = median_high(clouds.values()) if clouds else 0
    of = f"the usual {usual:,} scans of {'a turn' if per == 'turn' else 'half a turn'}"
    for path, scans in clouds.items():
        if scans < usual / 2:
            yield f"warning: {path.stem} holds {scans:,} of {of}: leave it out if clouds are registered"


def _comments(source: Recording, angles: AngleSet, width: int, scans: int, lag_s: float, on_map: bool) -> list[str]:
    organised = [f"width {width}", f"height {scans}"] if width else []
    return [
        *organised,
        f"task {angles.task}, angles from {angles.source}, frame {'of the poses' if on_map else 'world'}",
        "x y z in m, joint_rad in rad, ring is the beam",
        f"time_s 0 is {source.start_ns} ns",
        *([f"joint log taken as {lag_s} s late"] if lag_s else []),
    ]

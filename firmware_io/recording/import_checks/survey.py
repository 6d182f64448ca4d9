"""First pass over a foreign bag: times, headers and angles of all usable messages; errors raise RecordingError."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from scanwright.design.arrays import Floats, Times
from scanwright.design.errors import RecordingError, suggest
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.angle_sources import FrameSource, angles_in, turned_rad
from scanwright.firmware_io.recording.bag_clocks import Stamps
from scanwright.firmware_io.recording.bags import Bag, Source, laser_scan_at, scan_fault
from scanwright.firmware_io.recording.import_checks.corrections import Corrections
from scanwright.firmware_io.recording.import_checks.headers import Headers, header_of


@dataclass(frozen=True, slots=True, eq=False)
class BagSurvey:
    """Scans and angles of a bag; arrays have one entry per usable scan, or per usable angle."""

    scan_stamps: Stamps  # times of the scans
    headers: Headers  # of the scans
    range_limits_m: tuple[float, float]  # of the last scan
    endless: int  # scans without a longest range
    echoes: int  # most echoes of a ray that are kept
    angle_stamps: Stamps  # times of the angles
    angle: Floats  # in its unit
    turned: bool  # the angles come from quaternions, in radians
    angle_note: str  # warning, or empty
    left_out: Counter[str]  # reason -> number of messages


def survey_bag(
    bag: Bag,
    scan_source: Source,
    angle_source: Source | FrameSource | None,
    table: tuple[Times, Floats] | None,
    corrections: Corrections,
) -> BagSurvey:
    """Read all scans and angles; those of a table are given as times [ns] and angles, without an `angle_source`."""
    left_out: Counter[str] = Counter()
    scans: list[tuple[int, int, bool]] = []
    rows: list[tuple[Any, ...]] = []
    angles: list[tuple[int, int, tuple[float, ...]]] = []
    joints: set[str] = set()
    echoes, limits_m = 1, (0.0, 0.0)
    if table is not None:
        angles = [(when, when, (value,)) for when, value in zip(*(part.tolist() for part in table), strict=True)]
    topics = {scan_source.topic, *([] if angle_source is None else [angle_source.topic])}
    for message in bag.messages(topics):
        scan_stamp_ns = 0
        if message.topic == scan_source.topic:
            laser_scan, scan_stamp_ns = laser_scan_at(message.body, scan_source, bag.path, corrections.echo)
            fault = scan_fault(laser_scan)
            if fault:
                left_out[fault] += 1
            else:
                echoes = max(echoes, laser_scan.echoes[0].shape[1] if hasattr(laser_scan, "echoes") else 1)
                scans.append((scan_stamp_ns, message.receive_ns, endless(laser_scan)))
                limits_m = float(laser_scan.range_min), float(laser_scan.range_max)
                scan = ros_messages.scan_from_message(laser_scan, scan_stamp_ns or message.receive_ns)
                span_rad = float(laser_scan.angle_max) - scan.angle_min_rad
                rows.append(header_of(scan, span_rad, len(laser_scan.intensities)))
        if angle_source is not None and message.topic == angle_source.topic:
            values = angles_in(message.body, angle_source, bag.path)
            if not values and isinstance(angle_source, Source):
                left_out["message_without_the_joint"] += 1
                joints.update(message.body.name)
            for value, angle_stamp_ns in values:
                if all(map(math.isfinite, value)) and (len(value) == 1 or any(value)):
                    angles.append((angle_stamp_ns or scan_stamp_ns, message.receive_ns, value))
                else:
                    left_out["angle_not_a_number"] += 1
    for source, samples in ((scan_source, scans), (angle_source, angles)):
        if not samples:
            why = ", ".join(f"{count} {reason}" for reason, count in left_out.items()) or "it has no such message"
            if source is angle_source and isinstance(source, Source) and joints and source.field not in joints:
                why = f"no joint '{source.field}'{suggest(source.field, joints)}; known: {', '.join(sorted(joints))}"
                raise RecordingError(f"{bag.path}: {source.topic}: {why}")
            raise RecordingError(f"{bag.path}: {source}: nothing usable: {why}")
    scan_table = np.array([row[:2] for row in scans], np.int64)
    angle_table = np.array([row[:2] for row in angles], np.int64)
    numbers, note = np.array([row[2] for row in angles], dtype=float), ""
    turned = numbers.shape[1] == 4 and angle_source is not None
    if turned and angle_source is not None:
        angle, note = turned_rad(numbers, angle_source)
    else:
        angle = numbers[:, 0]
    return BagSurvey(
        scan_stamps=Stamps(*scan_table.T),
        headers=Headers.of(rows),
        range_limits_m=limits_m,
        endless=sum(row[2] for row in scans),
        echoes=echoes,
        angle_stamps=Stamps(*angle_table.T),
        angle=angle,
        turned=turned,
        angle_note=note,
        left_out=left_out,
    )


def endless(laser_scan: Any) -> bool:
    """Whether a scan has no longest range, as drivers that leave it at 0."""
    return not laser_scan.range_max > laser_scan.range_min

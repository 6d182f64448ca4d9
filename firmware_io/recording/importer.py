"""`scanwright import`: somebody else's bag becomes the project's recording.

Two passes over the bag. The first reads every time and every angle (small), the second copies the scans one by one.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanwright.design.arrays import Floats, Times
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import check_place
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.angle_sources import (
    AngleUnit,
    FrameSource,
    angles_in,
    is_table,
    parse_frames,
    read_table,
    turned_rad,
    unit_doubts,
)
from scanwright.firmware_io.recording.bag_clocks import (
    OneClock,
    Stamps,
    gap_warnings,
    log_at_rest,
    one_clock,
    times,
    unwrapped_log,
)
from scanwright.firmware_io.recording.bags import Bag, Source, laser_scan_at, open_bag, parse_source, scan_fault
from scanwright.firmware_io.recording.metadata import note_in, rests_in_scans
from scanwright.firmware_io.recording.recording import (
    BEAMS_TOPIC,
    JOINT_TOPIC,
    SCAN_TOPIC,
    MessageWriter,
    RecordingWriter,
)
from scanwright.firmware_io.samples import JointLog


@dataclass(frozen=True, slots=True)
class ImportSummary:
    """What an import wrote, what it left out and why, and what a person should know.

    Attributes:
        out: the recording.
        scans: scans written.
        beams: beams in them, returns or not.
        joint_samples: samples of the spin joint written.
        duration_s: from the first to the last scan.
        angle_deg: smallest and largest angle of the joint log.
        left_out: reason -> number of scans or angles.
        warnings: one sentence each.
    """

    out: Path
    scans: int
    beams: int
    joint_samples: int
    duration_s: float
    angle_deg: tuple[float, float]
    left_out: dict[str, int]
    warnings: tuple[str, ...]

    def lines(self) -> list[str]:
        """The same in words."""
        low, high = self.angle_deg
        return [
            *(f"warning: {warning}" for warning in self.warnings),
            *(f"left out {count:,}: {reason.replace('_', ' ')}" for reason, count in self.left_out.items() if count),
            f"wrote {self.scans:,} scans ({self.beams:,} beams) and {self.joint_samples:,} angles, {low:z.2f} to "
            f"{high:z.2f} deg, {self.duration_s:.1f} s, to {self.out}",
        ]


@dataclass(frozen=True, slots=True, eq=False)
class _Survey:
    """First pass. Scan arrays have one entry per usable scan, angle arrays one per usable angle."""

    scan_stamps: Stamps
    arc_ns: Times
    beams: NDArray[np.int64]
    endless: int
    angle_stamps: Stamps
    angle: Floats
    angle_note: str
    left_out: Counter[str]


def import_bag(
    bag: Path,
    out: Path,
    *,
    scan: str,
    angle: str,
    angle_unit: AngleUnit | None,
    hold: bool,
    also: Collection[str] = (),
) -> ImportSummary:
    """Write the scans and angles of a bag as a recording.

    Args:
        bag: ROS 1 or ROS 2 bag.
        out: the recording to write, `.mcap`.
        scan: TOPIC[:FIELD] of a LaserScan.
        angle: where the axis angle stands: TOPIC[:FIELD] of a number, which may lie in the same message as the scan,
            TOPIC:JOINT of a JointState, TOPIC:PARENT:CHILD of transforms, or FILE.csv[:COLUMN].
        angle_unit: unit of the angle; None for transforms, which have none.
        hold: the motor stands still during each scan: the angle of the scan's own message, or the last one before
            the scan, holds from its first to its last beam. A bag made from a recording of which this is known says
            so itself, and its log stays as it is.
        also: topics that come along as they are, such as poses and an IMU for `assemble`.

    Raises:
        RecordingError: the bag is unreadable, a topic or field is missing or of another type, or scans and angles
            have no time in common. Nothing is written then.
    """
    check_place(out, RecordingError)
    if out.suffix != ".mcap":
        raise RecordingError(f"{out}: a recording is an MCAP file; name it {out.with_suffix('.mcap').name}")
    if angle_unit not in ("deg", "rad", None):
        raise RecordingError(f"angle unit '{angle_unit}': write deg or rad")
    if out.resolve() == bag.resolve():
        raise RecordingError(f"{out}: this is the bag itself; name another file")
    scan_source = parse_source(scan)
    angle_source = None if is_table(angle) else parse_frames(angle) or parse_source(angle)
    if isinstance(angle_source, FrameSource):
        angle_unit = "rad"
    if angle_unit is None:
        raise RecordingError("angle unit: write deg or rad, as the bag has it")
    table = read_table(angle) if angle_source is None else None
    if reserved := {SCAN_TOPIC, JOINT_TOPIC, BEAMS_TOPIC}.intersection(also):
        raise RecordingError(f"also {min(reserved)}: the recording has a topic of its own under this name")
    with open_bag(bag) as opened:
        opened.check({scan_source.topic, *([] if angle_source is None else [angle_source.topic]), *also})
        survey = _survey(opened, scan_source, angle_source, table)
        clock = one_clock(survey.scan_stamps, survey.angle_stamps)
        in_time = (clock.scan_ns >= clock.angle_ns.min()) & (clock.scan_ns <= clock.angle_ns.max())
        if not in_time.any():
            spans = f"scans {_span(clock.scan_ns)}, angles {_span(clock.angle_ns)}"
            raise RecordingError(f"{bag}: no scan falls into the time of the angles: {spans}")
        log = unwrapped_log(clock.angle_ns, np.radians(survey.angle) if angle_unit == "deg" else survey.angle)
        doubled = clock.angle_ns.size - log.time_ns.size
        left_out = survey.left_out + Counter({"angle_at_the_time_of_another": doubled})
        warnings = [note for note in (clock.note, survey.angle_note) if note]
        warnings += unit_doubts(clock.angle_ns, survey.angle, log, angle_unit)
        warnings += _scan_warnings(survey, clock)
        if also and clock.note:
            warnings.append(f"{', '.join(sorted(also))}: their stamps may be of another clock than the scans' times")
        if not in_time.all():
            warnings.append(
                f"{np.sum(~in_time)} scans begin before the first or after the last angle: no point of them"
            )
        if hold:
            log, cut = log_at_rest(log, clock.scan_ns, survey.arc_ns)
            if cut:
                warnings.append(f"{cut} scans end after the next one begins: their last beams take its angle")
        still = hold or rests_in_scans(note_in(opened))
        if not still:
            warnings += gap_warnings(log)
        note = {
            "schema": "scanwright/recording/1",
            "source": bag.name,
            "scan": str(scan_source),
            "angle": str(angle_source or angle),
            "angle_unit": angle_unit,
            "hold": str(still).lower(),
            "warnings": "\n".join(warnings),
        }
        with RecordingWriter(out, note) as writer:
            _write(opened, scan_source, clock, log, writer, also)
    return ImportSummary(
        out=out,
        scans=clock.scan_ns.size,
        beams=int(survey.beams.sum()),
        joint_samples=log.time_ns.size,
        duration_s=float(np.ptp(clock.scan_ns)) / 1e9,
        angle_deg=(math.degrees(log.position_rad.min()), math.degrees(log.position_rad.max())),
        left_out=dict(left_out),
        warnings=tuple(warnings),
    )


def _survey(
    bag: Bag, scan_source: Source, angle_source: Source | FrameSource | None, table: tuple[Times, Floats] | None
) -> _Survey:
    left_out: Counter[str] = Counter()
    scans: list[tuple[int, int, int, int, bool]] = []
    angles: list[tuple[int, int, tuple[float, ...]]] = []
    if table is not None:
        angles = [(when, when, (value,)) for when, value in zip(*(part.tolist() for part in table), strict=True)]
    topics = {scan_source.topic, *([] if angle_source is None else [angle_source.topic])}
    for message in bag.messages(topics):
        scan_stamp_ns = 0
        if message.topic == scan_source.topic:
            laser_scan, scan_stamp_ns = laser_scan_at(message.body, scan_source, bag.path)
            fault = scan_fault(laser_scan)
            if fault:
                left_out[fault] += 1
            else:
                arc_ns = round(1e9 * float(laser_scan.time_increment) * (len(laser_scan.ranges) - 1))
                beams = len(laser_scan.ranges)
                scans.append((scan_stamp_ns, message.receive_ns, arc_ns, beams, _endless(laser_scan)))
        if angle_source is not None and message.topic == angle_source.topic:
            for value, angle_stamp_ns in angles_in(message.body, angle_source, bag.path):
                if all(map(math.isfinite, value)):
                    angles.append((angle_stamp_ns or scan_stamp_ns, message.receive_ns, value))
                else:
                    left_out["angle_not_a_number"] += 1
    for source, samples in ((scan_source, scans), (angle_source, angles)):
        if not samples:
            why = ", ".join(f"{count} {reason}" for reason, count in left_out.items()) or "it has no such message"
            raise RecordingError(f"{bag.path}: {source}: nothing usable: {why}")
    stamps, receives, arcs, widths, endless = zip(*scans, strict=True)
    angle_stamps, angle_receives, values = zip(*angles, strict=True)
    numbers, note = np.array(values, dtype=float), ""
    if isinstance(angle_source, FrameSource):
        angle, note = turned_rad(numbers, angle_source)
    else:
        angle = numbers[:, 0]
    return _Survey(
        scan_stamps=Stamps(times(stamps), times(receives)),
        arc_ns=times(arcs),
        beams=np.array(widths),
        endless=sum(endless),
        angle_stamps=Stamps(times(angle_stamps), times(angle_receives)),
        angle=angle,
        angle_note=note,
        left_out=left_out,
    )


def _endless(laser_scan: Any) -> bool:
    """Whether the longest range is not told: some drivers leave it 0."""
    return not laser_scan.range_max > laser_scan.range_min


def _scan_warnings(survey: _Survey, clock: OneClock) -> Iterator[str]:
    if not survey.arc_ns.any():
        yield "time_increment is 0: every beam takes the time of its scan's stamp, not its own"
    if survey.left_out["empty_scan"]:
        yield f"{survey.left_out['empty_scan']} scans have no beam and are left out"
    if np.ptp(survey.beams):
        yield f"scans have {survey.beams.min()} to {survey.beams.max()} beams: beam i is not the same direction in each"
    if np.any(np.diff(clock.scan_ns) <= 0):
        yield f"{int(np.sum(np.diff(clock.scan_ns) <= 0))} scans are not later than the one before them"
    if survey.endless:
        yield f"{survey.endless} scans have a range_max not above range_min: no longest range is applied"


def _write(
    bag: Bag, source: Source, clock: OneClock, log: JointLog, writer: MessageWriter, also: Collection[str]
) -> None:
    """Second pass: copy the scans, with the joint samples between them by time, and what comes along as received."""
    samples = list(zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True))
    written = 0
    scan_times = iter(clock.scan_ns.tolist())

    def write_scan(laser_scan: Any, beams: ros_messages.Beams | None) -> None:
        nonlocal written
        scan = ros_messages.scan_from_message(laser_scan, next(scan_times))
        if _endless(laser_scan):
            scan = replace(scan, range_max_m=math.inf)
        if beams is not None:
            scan = replace(scan, beam_bearing_rad=beams[0], beam_offset_ns=beams[1])
        while written < len(samples) and samples[written][0] <= scan.stamp_ns:
            writer.joint(*samples[written])
            written += 1
        writer.scan(scan)

    beams_topic = f"{source.topic}{BEAMS_TOPIC.removeprefix(SCAN_TOPIC)}"
    own = {beams_topic} if bag.topics.get(beams_topic) == ros_messages.POINT_CLOUD else set[str]()
    beams: dict[int, ros_messages.Beams] = {}  # by the stamp of their scan
    waiting: list[tuple[Any, int]] = []  # scans whose beams may come next: at one time bags have no order
    for message in bag.messages({source.topic, *own, *also}):
        if message.topic in also:
            writer.other(message.topic, bag.topics[message.topic], message.receive_ns, message.body)
        if message.topic in own:
            with suppress(ValueError):  # somebody else's cloud
                stamp_ns, beams_of_one = ros_messages.beams_in(message.body)
                beams[stamp_ns] = beams_of_one
        elif message.topic == source.topic:
            laser_scan, stamp_ns = laser_scan_at(message.body, source, bag.path)
            if not scan_fault(laser_scan):
                waiting.append((laser_scan, stamp_ns))
        while waiting and (not own or len(waiting) > 1 or waiting[0][1] in beams):
            laser_scan, stamp_ns = waiting.pop(0)
            write_scan(laser_scan, beams.pop(stamp_ns, None))
    for laser_scan, stamp_ns in waiting:
        write_scan(laser_scan, beams.pop(stamp_ns, None))
    for time_ns, position_rad in samples[written:]:
        writer.joint(time_ns, position_rad)


def _span(time_ns: Times) -> str:
    return f"{time_ns.min() / 1e9:.3f} to {time_ns.max() / 1e9:.3f} s"

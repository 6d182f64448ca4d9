"""`scanwright import`: the first pass over a bag reads times and angles, the second copies the scans."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scanwright.design.arrays import Times
from scanwright.design.errors import RecordingError
from scanwright.design.files.atomic_file import check_place
from scanwright.design.findings import Finding
from scanwright.firmware_io.recording import ros_messages
from scanwright.firmware_io.recording.angle_sources import (
    is_table,
    parse_frames,
    read_table,
    unit_doubts,
)
from scanwright.firmware_io.recording.bag_clocks import (
    OneClock,
    Stamps,
    log_at_rest,
    one_clock,
)
from scanwright.firmware_io.recording.bags import Bag, Source, laser_scan_at, open_bag, parse_source, scan_fault
from scanwright.firmware_io.recording.import_checks.angles import angle_findings, outliers, usual_speed_rad_s
from scanwright.firmware_io.recording.import_checks.clocks import clock_findings
from scanwright.firmware_io.recording.import_checks.corrections import Corrections, radians_per
from scanwright.firmware_io.recording.import_checks.headers import AT_M, header_findings
from scanwright.firmware_io.recording.import_checks.imu import imu_findings
from scanwright.firmware_io.recording.import_checks.survey import BagSurvey, endless, survey_bag
from scanwright.firmware_io.recording.mcap_chunks import rests_in_scans
from scanwright.firmware_io.recording.recording import (
    BEAMS_TOPIC,
    JOINT_TOPIC,
    SCAN_TOPIC,
    MessageWriter,
    recording_writer,
)
from scanwright.firmware_io.samples import JointLog, with_all_echoes

_AS_IT_IS = Corrections()
_DELAY = "stamp scans and angles with one clock; scan_offset_s = 0.01 delays scans, calibrate estimates the delay"
_ZERO_BEYOND = 0.2  # of the sweep
_LONG_GAP = 10.0  # times the median gap between angles, to warn
_PER_SCAN = 1.2  # angles per scan; fewer are one for each scan


@dataclass(frozen=True, slots=True)
class ImportSummary:
    """Result of an import.

    Attributes:
        out: the recording.
        scans: written.
        beams: in them, with or without a return.
        joint_samples: written.
        duration_s: from the first to the last scan.
        angle_deg: smallest and largest angle of the joint log.
        left_out: dropped scans or angles, reason -> count.
        findings: of the checks.
        geometry: of the scans, as one line.
    """

    out: Path
    scans: int
    beams: int
    joint_samples: int
    duration_s: float
    angle_deg: tuple[float, float]
    left_out: dict[str, int]
    findings: tuple[Finding, ...]
    geometry: str = ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Messages of the findings that are warnings."""
        return tuple(finding.message for finding in self.findings if finding.severity == "warning")

    def lines(self) -> list[str]:
        """Format the summary."""
        low, high = self.angle_deg
        lines = []
        for finding in self.findings:
            lines.append(f"{finding.severity}: {finding.message}")
            if finding.hint:
                lines.append(f"  hint: {finding.hint}")
        return [
            *lines,
            *([f"scans: {self.geometry}"] if self.geometry else []),
            *(f"left out {count:,}: {reason.replace('_', ' ')}" for reason, count in self.left_out.items() if count),
            f"wrote {self.scans:,} scans ({self.beams:,} beams) and {self.joint_samples:,} angles, {low:z.2f} to "
            f"{high:z.2f} deg, {self.duration_s:.1f} s, to {self.out}",
        ]


def import_bag(
    bag: Path | Sequence[Path],
    out: Path,
    *,
    scan: str,
    angle: str,
    angle_unit: str | None,
    hold: bool,
    also: Collection[str] = (),
    corrections: Corrections = _AS_IT_IS,
) -> ImportSummary:
    """Write the scans and angles of a bag as a recording; the arguments are those of `scanwright.import_bag`.

    Raises:
        RecordingError: the bag is unreadable, a topic or field is missing or of another type, or scans and angles
            have no time in common; nothing is written.
    """
    parts = [bag] if isinstance(bag, Path) else list(bag)
    _check_target(out, parts)
    scan_source = parse_source(scan)
    angle_source = None if is_table(angle) else parse_frames(angle) or parse_source(angle)
    unit_rad = radians_per(angle_unit) if angle_unit else None
    table = read_table(angle) if angle_source is None else None
    if reserved := {SCAN_TOPIC, JOINT_TOPIC, BEAMS_TOPIC}.intersection(also):
        raise RecordingError(f"also {min(reserved)}: the recording already has a topic of this name")
    with open_bag(*parts) as opened:
        opened.check({scan_source.topic, *([] if angle_source is None else [angle_source.topic]), *also})
        survey = survey_bag(opened, scan_source, angle_source, table, corrections)
        if survey.turned:
            angle_unit, unit_rad = "rad", 1.0
        if unit_rad is None or angle_unit is None:
            raise RecordingError("angle_unit: write deg or rad, as the bag has it, or counts such as 4096/turn")
        headers = survey.headers.corrected(None, corrections)
        increment_s = corrections.time_increment  # None for that of each scan
        increment_s = headers.time_increment_from_turn_s if increment_s == "auto" else increment_s
        stated_s = headers.time_increment_s if increment_s is None else increment_s
        arc_ns = np.rint(1e9 * stated_s * (headers.beams - 1)).astype(np.int64)
        clock = _corrected(one_clock(survey.scan_stamps, survey.angle_stamps, arc_ns), survey, arc_ns, corrections)
        outside = (clock.scan_ns < clock.angle_ns.min()) | (clock.scan_ns > clock.angle_ns.max())
        if outside.all():
            spans = f"scans {_span(clock.scan_ns)}, angles {_span(clock.angle_ns)}"
            raise RecordingError(f"{parts[0]}: no scan falls into the time of the angles: {spans}")
        log, left_out = _joint_log(clock, survey, unit_rad, corrections)
        still = hold or rests_in_scans(opened.note())
        speed_rad_s = 0.0 if still else usual_speed_rad_s(log)
        cost = f"; 10 ms of it are {10 * AT_M * speed_rad_s:,.0f} mm at {AT_M:g} m at this speed" if speed_rad_s else ""
        findings = [_remark("clock", clock.note + cost, _DELAY)] if clock.note else []
        if survey.angle_note:
            findings.append(_remark("angle_zero", survey.angle_note, "angle_zero sets the joint position 0"))
        doubts = unit_doubts(clock.angle_ns, survey.angle, log, angle_unit)
        findings += [_remark("angle_unit", doubt, hint) for doubt, hint in doubts]
        if not still:
            order = np.argsort(clock.angle_ns, kind="stable")
            angle_rad, timed = survey.angle[order] * unit_rad, not clock.note
            dropped = corrections.drop_outliers
            findings += angle_findings(clock.angle_ns[order], angle_rad, dropped=dropped, timed=timed)
        checked = headers.corrected(increment_s, corrections)
        findings += header_findings(checked, speed_rad_s)
        if not clock.note and corrections.stamp != "receipt":  # the times of the scans are their stamps
            stamps = Stamps(clock.scan_ns, survey.scan_stamps.receive_ns)
            same_clock = angle_source is not None and angle_source.topic == scan_source.topic
            arcs_ns = checked.judged().arc_ns
            findings += clock_findings(stamps, survey.angle_stamps, arcs_ns, speed_rad_s, same_clock=same_clock)
        findings += _scan_findings(survey)
        findings += imu_findings(opened, survey.angle_stamps.receive_ns, np.unwrap(survey.angle * unit_rad))
        findings += _zero_outside(log, unit_rad, corrections)
        if also and clock.note:
            also_note = f"{', '.join(sorted(also))}: their stamps may be of another clock than the scans' times"
            findings.append(_remark("also_clock", also_note, "give them, the scans and the angles stamps of one clock"))
        if outside.any():
            none = f"{np.sum(outside)} scans begin before the first or after the last angle: no point of them"
            findings.append(_remark("scans_outside", none, "record the angles from before the first scan to its end"))
        if hold:
            log, cut = log_at_rest(log, clock.scan_ns, arc_ns)
            if cut:
                short = f"{cut} scans end after the next one begins: their last beams take its angle"
                findings.append(_remark("scans_overlap", short, 'time_increment = "auto" if that of the scans is long'))
        if not still:
            findings += _between_angles(log, clock.scan_ns, speed_rad_s)
        note = {
            "schema": "scanwright/recording/1",
            "source": parts[0].name,
            "scan": str(scan_source),
            "angle": str(angle_source or angle),
            "angle_unit": angle_unit,
            "hold": str(still).lower(),
            "warnings": "\n".join(finding.message for finding in findings if finding.severity == "warning"),
        }
        with recording_writer(out, note) as writer:
            _write(opened, scan_source, clock, log, writer, also, corrections, increment_s, survey.echoes)
    return ImportSummary(
        out=out,
        scans=clock.scan_ns.size,
        beams=int(headers.beams.sum()) * survey.echoes,
        joint_samples=log.time_ns.size,
        duration_s=float(np.ptp(clock.scan_ns)) / 1e9,
        angle_deg=(math.degrees(log.position_rad.min()), math.degrees(log.position_rad.max())),
        left_out=dict(left_out),
        findings=tuple(findings),
        geometry=_geometry(survey),
    )


def _geometry(survey: BagSurvey) -> str:
    """Describe the scans by what identifies a lidar."""
    headers = survey.headers
    low, high = int(headers.beams.min()), int(headers.beams.max())
    beams = f"{low:,}" if low == high else f"{low:,} to {high:,}"
    span_deg, step_deg = (math.degrees(float(np.median(np.abs(x)))) for x in (headers.span_rad, headers.step_rad))
    turn_s = headers.mirror_turn_s
    rate = f", a turn in {turn_s:.4g} s" if turn_s else ""
    limits = f"range limits {survey.range_limits_m[0]:.4g} to {survey.range_limits_m[1]:.4g} m"
    return f"{beams} beams over {span_deg:.5g} deg, step {step_deg:.4g} deg{rate}, {limits}"


def _check_target(out: Path, bags: Sequence[Path]) -> None:
    check_place(out, RecordingError)
    if out.suffix != ".mcap":
        raise RecordingError(f"{out}: a recording is an MCAP file; name it {out.with_suffix('.mcap').name}")
    if out.resolve() in [bag.resolve() for bag in bags]:
        raise RecordingError(f"{out}: this is the bag itself; name another file")


def _joint_log(
    clock: OneClock, survey: BagSurvey, unit_rad: float, corrections: Corrections
) -> tuple[JointLog, Counter[str]]:
    """Return the joint positions in the order of their times, and the counts of dropped messages."""
    order = np.argsort(clock.angle_ns, kind="stable")
    time_ns, angle = clock.angle_ns[order], survey.angle[order]
    wrong = outliers(time_ns, angle * unit_rad)[0] & corrections.drop_outliers
    unique_ns, first = np.unique(time_ns[~wrong], return_index=True)
    turned_rad = np.unwrap((angle[~wrong][first] - corrections.angle_zero) * unit_rad)
    dropped = int(wrong.sum())
    doubled = order.size - dropped - unique_ns.size
    left_out = survey.left_out + Counter({"angle_at_the_time_of_another": doubled, "angle_outlier": dropped})
    return JointLog(unique_ns, corrections.angle_scale * turned_rad), left_out


def _corrected(clock: OneClock, survey: BagSurvey, arc_ns: Times, corrections: Corrections) -> OneClock:
    """Return the times after the corrections of stamps."""
    scan_ns, angle_ns, note = clock.scan_ns, clock.angle_ns, clock.note
    if corrections.stamp == "receipt":
        scan_ns, angle_ns, note = survey.scan_stamps.receive_ns - arc_ns, survey.angle_stamps.receive_ns, ""
    elif corrections.stamp == "last":
        scan_ns = scan_ns - arc_ns
    return OneClock(scan_ns + round(1e9 * corrections.scan_offset_s), angle_ns, note)


def _remark(code: str, message: str, hint: str) -> Finding:
    return Finding(code, "warning", "recording", message, hint=hint)


def _scan_findings(survey: BagSurvey) -> Iterator[Finding]:
    beams = survey.headers.beams
    if survey.left_out["empty_scan"]:
        none = f"{survey.left_out['empty_scan']} scans have no beam and are left out: no points at their angles"
        yield _remark("empty_scans", none, "check the connection of the lidar; a few at its start do no harm")
    if np.ptp(beams):
        many = f"scans have {beams.min()} to {beams.max()} beams; each is placed by its own header"
        if np.ptp(survey.headers.step_rad):
            yield Finding("ragged_scans", "note", "recording", many)
        else:
            lost_mm = 1000 * AT_M * float(np.ptp(beams) * np.median(np.abs(survey.headers.step_rad)))
            lost = f"{many}, all with one angle_increment: if beams are missing inside a scan, those after them are off"
            hint = 'bearings = "limits" if all scans cover the same angle'
            yield _remark("ragged_scans", f"{lost} by up to {lost_mm:,.0f} mm at {AT_M:g} m", hint)
    if survey.endless:
        none = f"{survey.endless} scans have a range_max not above range_min: no longest range is applied"
        yield _remark("no_range_max", none, "no_return_from_m = 30 drops ranges from the longest one of the lidar on")


def _zero_outside(log: JointLog, unit_rad: float, corrections: Corrections) -> Iterator[Finding]:
    """Note that a sweep never comes near joint position 0, at which the angle set describes the scanner."""
    low, high = float(log.position_rad.min()), float(log.position_rad.max())
    beyond = max(low, -high) > _ZERO_BEYOND * (high - low)
    if beyond and not corrections.angle_zero and high - low < 2 * math.pi:
        middle = (low + high) / 2 / corrections.angle_scale
        square = round(middle / (math.pi / 2)) * math.pi / 2
        zero = (square if abs(square - middle) < (high - low) / 4 else middle) / unit_rad
        never = "the axis never comes near joint position 0, at which the angle set describes the scanner"
        yield Finding("zero_outside", "note", "angle", never, hint=f"angle_zero = {zero:.6g} if it is level there")


def _between_angles(log: JointLog, scan_ns: Times, speed_rad_s: float) -> Iterator[Finding]:
    """Report sparse angles: with gaps, or only one for each scan."""
    gaps_s = np.diff(log.time_ns) / 1e9
    if gaps_s.size and (gap_s := float(gaps_s.max())) > _LONG_GAP * (usual_s := float(np.median(gaps_s))):
        gap = f"between two angles lie up to {gap_s:.2f} s (usually {usual_s:.3f} s): the angle goes straight across"
        off_mm = 1000 * AT_M * speed_rad_s * gap_s / 2
        cost = f", up to {off_mm:,.0f} mm off at {AT_M:g} m at this speed if it turned back" if off_mm else ""
        yield _remark("angle_gaps", gap + cost, "publish angles at 50 Hz or more; distrust walls seen at these times")
    moving = np.abs(np.diff(log.position_rad)) > 0
    if log.time_ns.size <= _PER_SCAN * scan_ns.size and moving.any():
        step_mm = 1000 * AT_M * float(np.median(np.abs(np.diff(log.position_rad))[moving]))
        one = f"{log.time_ns.size:,} angles for {scan_ns.size:,} scans: the axis is taken to turn evenly between them"
        cost = f"; if it rested during each scan, beams are up to {step_mm:,.0f} mm off at {AT_M:g} m"
        yield _remark("angles_sparse", one + cost, "hold = true if the axis rested; otherwise publish angles at 50 Hz")


def _write(
    bag: Bag,
    source: Source,
    clock: OneClock,
    log: JointLog,
    writer: MessageWriter,
    also: Collection[str],
    corrections: Corrections,
    time_increment_s: float | None,
    echoes: int,
) -> None:
    """Write the scans and joint samples in the order of time, and copy other topics."""
    samples = list(zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True))
    written = 0
    scan_times = iter(clock.scan_ns.tolist())

    def write_scan(laser_scan: Any, beams: ros_messages.Beams | None) -> None:
        nonlocal written
        scan = ros_messages.scan_from_message(laser_scan, next(scan_times))
        if time_increment_s is not None:
            scan = replace(scan, time_increment_s=time_increment_s)
        if corrections.bearings == "limits" and scan.range_m.size > 1:
            span_rad = float(laser_scan.angle_max) - scan.angle_min_rad
            scan = replace(scan, angle_increment_rad=span_rad / (scan.range_m.size - 1))
        if hasattr(laser_scan, "echoes"):
            range_m, intensity = laser_scan.echoes
            scan = with_all_echoes(scan, range_m, intensity, echoes)
        if corrections.no_return_from_m is not None:
            far = scan.range_m >= np.float32(corrections.no_return_from_m)
            scan = replace(scan, range_m=np.where(far, np.float32(np.inf), scan.range_m))
        if endless(laser_scan):
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
    waiting: list[tuple[Any, int]] = []  # scans whose beams may be next, as messages of one time have no order
    for message in bag.messages({source.topic, *own, *also}):
        if message.topic in also:
            writer.other(message.topic, bag.topics[message.topic], message.receive_ns, message.body)
        if message.topic in own:
            with suppress(ValueError):  # another cloud
                stamp_ns, beams_of_one = ros_messages.beams_in(message.body)
                beams[stamp_ns] = beams_of_one
        elif message.topic == source.topic:
            laser_scan, stamp_ns = laser_scan_at(message.body, source, bag.path, corrections.echo)
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

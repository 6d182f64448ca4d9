"""Do the import checks report every fault that matters? Random faults in good recordings.

    python -m benchmarks.firmware_io.recordings.import_mutations 400 [FIRST_SEED] [corrected] [small]

Each sample is a good recording of a random scanner with one random fault in its headers, clocks or angles. It is
imported, and the place of every beam at 5 m is compared with the truth. A sample is wrong if more than 1 % of its beams
are off by more than 5 mm; it must then have a warning, or be refused. The rest must have none. With `corrected` each
reported sample is imported again with the corrections that its hints offer, and judged again. With `small` faults have
a hundredth to one times the smallest size of the others: it prints below which error each kind can be missed.

Left out are faults that a recording cannot show: the wrong sense of an angle or of the beams with limits to match, a
wrong angle_max that nothing uses, and offsets between clocks below 15 ms, as the transport of messages hides them.
"""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.random import Generator
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from scanwright.design.arrays import Floats, Ints
from scanwright.design.errors import RecordingError
from scanwright.design.findings import Finding
from scanwright.firmware_io.recording.import_checks.corrections import Corrections
from scanwright.firmware_io.recording.importer import ImportSummary, import_bag
from scanwright.firmware_io.recording.recording import open_recording

START_NS = 1_700_000_000 * 10**9
WRONG_MM = 5.0
AT_M = 5.0
WRONG_SHARE = 0.01
_APART_M = 0.01  # between the ranges of neighbouring scans, by which a scan is known again


@dataclass(frozen=True)
class Fake:
    """A recording in memory; rows are scans, or angles. Times are ns."""

    scan_ns: Ints
    scan_receive_ns: Ints
    angle_ns: Ints
    angle_receive_ns: Ints
    angle_rad: Floats
    beams: int
    angle_min: float
    angle_max: float
    increment: float
    time_increment: Floats
    scan_time: float
    ranges: Floats
    range_max: float
    motion: Callable[[Floats], Floats]
    true_ns: Ints
    true_increment: float
    true_time_increment: float
    false_points: bool = False
    unequal: bool = field(default=False)


def good(rng: Generator) -> Fake:
    """A scanner that spins or sweeps, with a lidar of a random field of view."""
    period_s = float(rng.choice([0.025, 0.05, 0.1]))
    step = math.radians(float(rng.choice([0.5, 1.0])))
    beams = int(rng.uniform(180, 360) / math.degrees(step))
    swing = float(rng.uniform(0.5, 1.5))
    spins = rng.random() < 0.6
    speed = math.radians(float(np.exp(rng.uniform(np.log(30), np.log(360 if spins else 120)))))

    def motion(seconds: Floats) -> Floats:
        return speed * seconds if spins else swing * np.sin(speed / swing * seconds)

    scans = 80
    true_ns = START_NS + 10**8 + np.arange(scans) * round(1e9 * period_s)
    ti = step / (2 * math.pi) * period_s
    rate_hz = float(rng.choice([50, 100, 200]))
    angle_ns = START_NS + np.arange(0, int((scans * period_s + 0.3) * rate_hz)) * round(1e9 / rate_hz)
    end_ns = true_ns + round(1e9 * ti * (beams - 1))
    ranges = 1 + _APART_M * np.arange(scans)[:, None] + rng.uniform(0, _APART_M / 3, (scans, beams))
    return Fake(
        scan_ns=true_ns,
        scan_receive_ns=end_ns + rng.integers(1_000_000, 4_000_000, scans),
        angle_ns=angle_ns,
        angle_receive_ns=angle_ns + rng.integers(300_000, 3_000_000, angle_ns.size),
        angle_rad=motion((angle_ns - START_NS) / 1e9),
        beams=beams,
        angle_min=-step * (beams - 1) / 2,
        angle_max=step * (beams - 1) / 2,
        increment=step,
        time_increment=np.full(scans, ti),
        scan_time=period_s if rng.random() < 0.7 else 0.0,
        ranges=ranges,
        range_max=30.0,
        motion=motion,
        true_ns=true_ns,
        true_increment=step,
        true_time_increment=ti,
    )


class Small(Generator):
    """Draws small faults."""


def _size(rng: Generator, low: float, high: float) -> float:
    """A random size of a random sign, evenly by its logarithm."""
    if isinstance(rng, Small):
        low, high = low / 100, low
    return float(np.exp(rng.uniform(np.log(low), np.log(high))) * rng.choice([-1, 1]))


def _some(rng: Generator, count: int, low: float = 0.01, high: float = 0.08) -> Ints:
    """Random rows, no two adjacent, none at the ends."""
    rows = np.arange(6, count - 6, 5)
    return rng.choice(rows, max(1, min(rows.size, int(count * rng.uniform(low, high)))), replace=False)


def _spikes(one: Fake, rng: Generator, value: Callable[[Floats], Floats]) -> Fake:
    angle, rows = one.angle_rad.copy(), _some(rng, one.angle_rad.size)
    angle[rows] = value(angle[rows])
    return replace(one, angle_rad=angle)


def _stepped(times_ns: Ints, rng: Generator, seconds: float) -> Ints:
    after = np.arange(times_ns.size) > times_ns.size * rng.uniform(0.3, 0.7)
    return times_ns + np.where(after, round(1e9 * seconds), 0)


def _drifting(times_ns: Ints, share: float) -> Ints:
    return times_ns + np.rint((times_ns - times_ns[0]) * share).astype(np.int64)


def _no_returns(one: Fake, rng: Generator) -> Fake:
    lost = rng.random(one.ranges.shape) < rng.uniform(0.03, 0.3)
    far = one.range_max if rng.random() < 0.5 else 65.533
    range_max = one.range_max if far == one.range_max else 80.0
    return replace(one, ranges=np.where(lost, far, one.ranges), range_max=range_max, false_points=True)


def _frozen(one: Fake, rng: Generator) -> Fake:
    angle = one.angle_rad.copy()
    begin = int(angle.size * rng.uniform(0.3, 0.6))
    length = int(angle.size * rng.uniform(0.05, 0.15)) + 6
    angle[begin : begin + length] = angle[begin]
    return replace(one, angle_rad=angle)


def _thinned(one: Fake, rng: Generator) -> Fake:
    keep = np.ones(one.angle_ns.size, bool)
    keep[_some(rng, keep.size, 0.02, 0.15)] = False
    picked = {name: getattr(one, name)[keep] for name in ("angle_ns", "angle_receive_ns", "angle_rad")}
    return replace(one, **picked)


def _turned_back(one: Fake, _: Generator) -> Fake:
    return replace(one, angle_min=-one.angle_min, angle_max=-one.angle_max)


def _end(one: Fake) -> int:
    return round(1e9 * one.true_time_increment * (one.beams - 1))


FAULTS: dict[str, Callable[[Fake, Generator], Fake]] = {
    "none": lambda one, _: one,
    "late transport": lambda one, rng: replace(
        one, scan_receive_ns=one.scan_receive_ns + rng.integers(0, 9_000_000, one.scan_ns.size)
    ),
    "a stall of the network": lambda one, _: replace(
        one,
        scan_receive_ns=np.maximum.accumulate(
            one.scan_receive_ns + np.where(np.arange(one.scan_ns.size) // 5 == 7, 80_000_000, 0)
        ),
    ),
    "angles lost": _thinned,
    "scan_time not given": lambda one, _: replace(one, scan_time=0.0),
    "intensities lost": lambda one, _: replace(one, unequal=True),
    "both clocks set": lambda one, rng: (
        lambda by: replace(one, scan_ns=one.scan_ns + by, angle_ns=one.angle_ns + by)
    )(round(1e9 * _size(rng, 0.02, 1e4))),
    "increment negative": lambda one, _: replace(one, increment=-one.increment),
    "limits exchanged": _turned_back,
    "increment off": lambda one, rng: replace(one, increment=one.increment * math.exp(_size(rng, 0.02, 1))),
    "time_increment off": lambda one, rng: replace(
        one, time_increment=one.time_increment * math.exp(_size(rng, 0.2, 2.5))
    ),
    "time_increment 0": lambda one, _: replace(one, time_increment=0 * one.time_increment),
    "time_increment changes": lambda one, rng: replace(
        one, time_increment=one.time_increment * np.where(rng.random(one.scan_ns.size) < 0.2, rng.uniform(2, 5), 1)
    ),
    "stamp of the last beam": lambda one, _: replace(one, scan_ns=one.scan_ns + _end(one)),
    "scan clock apart": lambda one, rng: replace(one, scan_ns=one.scan_ns + round(1e9 * _size(rng, 0.015, 3))),
    "angle clock apart": lambda one, rng: replace(one, angle_ns=one.angle_ns + round(1e9 * _size(rng, 0.015, 3))),
    "an hour apart": lambda one, rng: replace(one, scan_ns=one.scan_ns + round(1e9 * _size(rng, 1800, 7200))),
    "scan clock set": lambda one, rng: replace(one, scan_ns=_stepped(one.scan_ns, rng, _size(rng, 0.008, 0.8))),
    "angle clock set": lambda one, rng: replace(one, angle_ns=_stepped(one.angle_ns, rng, _size(rng, 0.008, 0.8))),
    "scan clock drifts": lambda one, rng: replace(one, scan_ns=_drifting(one.scan_ns, _size(rng, 0.003, 0.05))),
    "angle clock drifts": lambda one, rng: replace(one, angle_ns=_drifting(one.angle_ns, _size(rng, 0.003, 0.05))),
    "no return is far": _no_returns,
    "angle 0 now and then": lambda one, rng: _spikes(one, rng, lambda angle: 0 * angle),
    "angle of 32768 counts": lambda one, rng: _spikes(one, rng, lambda a: 0 * a + 32768 * 2 * math.pi / 4096 + 1),
    "angle outliers": lambda one, rng: _spikes(one, rng, lambda a: a + _size(rng, math.radians(20), 3)),
    "angle not a number": lambda one, rng: _spikes(one, rng, lambda angle: math.nan * angle),
    "angle frozen": _frozen,
}  # fmt: skip


def write(one: Fake, path: Path) -> None:
    """Write a recording as a bag of ROS 1, in the order of receipt."""
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types

    def header(time_ns: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        return types["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id="x")

    def scan(k: int) -> Any:
        return types["sensor_msgs/msg/LaserScan"](
            header=header(int(one.scan_ns[k])),
            angle_min=one.angle_min,
            angle_max=one.angle_max,
            angle_increment=one.increment,
            time_increment=float(one.time_increment[k]),
            scan_time=one.scan_time,
            range_min=0.1,
            range_max=one.range_max,
            ranges=one.ranges[k].astype(np.float32),
            intensities=np.zeros(3 if one.unequal else 0, np.float32),
        )

    def joint(k: int) -> Any:
        return types["sensor_msgs/msg/JointState"](
            header=header(int(one.angle_ns[k])),
            name=["pan"],
            position=np.array([one.angle_rad[k]]),
            velocity=np.empty(0),
            effort=np.empty(0),
        )

    rows = [(int(when), scan, k) for k, when in enumerate(one.scan_receive_ns)]
    rows += [(int(when), joint, k) for k, when in enumerate(one.angle_receive_ns)]
    with Writer(path) as writer:
        topics = {
            scan: writer.add_connection("/scan", "sensor_msgs/msg/LaserScan", typestore=store),
            joint: writer.add_connection("/joint", "sensor_msgs/msg/JointState", typestore=store),
        }
        for when, make, k in sorted(rows, key=lambda row: row[0]):
            message = make(k)
            kind = "sensor_msgs/msg/LaserScan" if make is scan else "sensor_msgs/msg/JointState"
            writer.write(topics[make], when, store.serialize_ros1(message, kind))


def errors_mm(one: Fake, recording: Path) -> Floats:
    """How far each beam is off at 5 m, shape (beams,)."""
    opened = open_recording(recording)
    off = []
    for scan in opened.scans():
        k = int((scan.range_m.min() - 1) / _APART_M + 0.1)
        beam = np.arange(scan.range_m.size)
        true_s = (one.true_ns[k] - START_NS) / 1e9 + beam * one.true_time_increment
        joint = opened.joint_log.angle_at(scan.time_ns)
        turned = joint - one.motion(true_s)
        bearing = scan.bearing_rad - (-one.true_increment * (one.beams - 1) / 2 + beam * one.true_increment)
        known = np.isfinite(turned)
        off.append(1000 * AT_M * (np.abs(np.sin(turned / 2)) * 2 + np.abs(bearing))[known])
    return np.concatenate(off)


_OFFERED = re.compile(r'^(\w+) = "?([\w.+-]+)"?')


@dataclass(frozen=True)
class Sample:
    """What became of one recording.

    Attributes:
        fault: its fault.
        seed: of the generator.
        error_mm: that 99 % of its beams keep at 5 m.
        codes: of its warnings.
        offered: names of the corrections that its hints offer.
        corrected_mm: as error_mm, of the import with these; NaN if it was not tried.
    """

    fault: str
    seed: int
    error_mm: float
    codes: tuple[str, ...]
    offered: tuple[str, ...] = ()
    corrected_mm: float = math.nan

    @property
    def missed(self) -> bool:
        """Wrong, and not reported."""
        return self.error_mm > WRONG_MM and not self.codes

    @property
    def false_alarm(self) -> bool:
        """Reported, though harmless."""
        return self.error_mm <= WRONG_MM and bool(self.codes)


def offered(findings: Iterable[Finding]) -> Corrections:
    """Return the corrections that the hints of warnings offer."""
    values: dict[str, Any] = {}
    for finding in findings:
        if finding.severity == "warning" and (match := _OFFERED.match(finding.hint)):
            name, text = match.groups()
            number = name in ("scan_offset_s", "no_return_from_m")
            values[name] = float(text) if number else True if text == "true" else text
    return Corrections(**values)


def _imported(one: Fake, bag: Path, corrections: Corrections) -> tuple[ImportSummary, float]:
    out = bag.with_suffix(".mcap")
    summary = import_bag(
        bag, out, scan="/scan", angle="/joint:pan", angle_unit="rad", hold=False, corrections=corrections
    )
    false_points = one.false_points and corrections.no_return_from_m is None
    return summary, math.inf if false_points else float(np.quantile(errors_mm(one, out), 1 - WRONG_SHARE))


def sample(seed: int, folder: Path, *, corrected: bool = False, small: bool = False) -> Sample:
    """Make, import and judge one recording, and what its hints make of it."""
    rng = (Small if small else Generator)(np.random.PCG64(seed))
    fault = list(FAULTS)[seed % len(FAULTS)]
    one = FAULTS[fault](good(rng), rng)
    bag = folder / "in.bag"
    bag.unlink(missing_ok=True)
    write(one, bag)
    try:
        summary, error_mm = _imported(one, bag, Corrections())
    except RecordingError as error:
        return Sample(fault, seed, math.inf, (f"refused: {error}",))
    codes = tuple(finding.code for finding in summary.findings if finding.severity == "warning")
    offer = offered(summary.findings)
    if not corrected or offer == Corrections():
        return Sample(fault, seed, error_mm, codes)
    names = tuple(each.name for each in fields(offer) if getattr(offer, each.name) != each.default)
    return Sample(fault, seed, error_mm, codes, names, _imported(one, bag, offer)[1])


def main(count: int, first: int, *, corrected: bool, small: bool) -> int:
    """Judge `count` recordings from a first seed on; print what was missed and what was reported though harmless."""
    with TemporaryDirectory() as folder:
        samples = [sample(seed, Path(folder), corrected=corrected, small=small) for seed in range(first, first + count)]
    for one in samples:
        if (one.missed and not small) or one.false_alarm:
            what = "missed" if one.missed else "false alarm"
            print(f"{what:12} {one.fault:24} seed {one.seed}: {one.error_mm:8.1f} mm {', '.join(one.codes)}")
    wrong = sum(one.error_mm > WRONG_MM for one in samples)
    missed, alarms = sum(one.missed for one in samples), sum(one.false_alarm for one in samples)
    print(f"{count} recordings, {wrong} wrong by more than {WRONG_MM:g} mm at {AT_M:g} m: {missed} not reported")
    print(f"{count - wrong} harmless: {alarms} reported ({alarms / max(count - wrong, 1):.1%})")
    print(", ".join(f"{fault} {n}" for fault, n in Counter(one.fault for one in samples if one.codes).items()))
    for fault in FAULTS if small else ():
        errors = [one.error_mm for one in samples if one.fault == fault and one.missed]
        if errors:
            print(f"{fault:24} {len(errors)} missed, up to {max(errors):.1f} mm")
    for fault in FAULTS if corrected else ():
        some = [one for one in samples if one.fault == fault and one.offered and one.error_mm > WRONG_MM]
        if some:
            right = sum(one.corrected_mm <= WRONG_MM for one in some)
            worst = max(some, key=lambda one: one.corrected_mm)
            names = ", ".join(sorted({name for one in some for name in one.offered}))
            rest = f"; worst {worst.corrected_mm:.1f} mm (seed {worst.seed})"
            print(f"{fault:24} {right} of {len(some)} right after {names}{rest}")
    return int(missed > 0)


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    modes = {mode: mode in sys.argv for mode in ("corrected", "small")}
    sys.exit(main(*(*numbers, *(324, 0)[len(numbers) :]), **modes))

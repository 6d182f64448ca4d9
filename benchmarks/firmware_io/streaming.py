"""What points cost while the scanner turns, and how exact they are: `python -m benchmarks.firmware_io.streaming`.

A UTM-30LX (1,081 beams, 40 scans a second) on a servo of 4096 steps a turn with the ripple of its gears, asked a
hundred times a second at uneven times, pushed through an `Assembler` in the order in which things were measured.

The first table is of time: processor time for each second of the scanner, the slowest push (of the processor too), the
growth of memory, and whether anything of the CAD kernel was loaded. The second is of the look-ahead: rms errors of the
axis angle in thousandths of a degree against the true motion, beside what the curve states and beside the smoothing of
the whole recording, for three speeds.
"""

from __future__ import annotations

import math
import resource
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.arrays import Floats
from scanwright.firmware_io.assembly.axis_curve import axis_curve
from scanwright.firmware_io.assembly.streaming import LOOK_AHEAD_S, Assembler, ScanPoints
from scanwright.firmware_io.samples import JointLog, JointSample, Scan, straight

START_NS = 1_700_000_000_000_000_000
ANGLES = AngleSet(
    task="streaming",
    angles_deg=Angles(alpha_rot=10, beta_rot=-55, alpha_laser=-80, beta_laser=75),
    sensor="UTM-30LX",
    servo="MX-64R",
    motion={"mode": "spin", "period_s": 18.0},
)
_BEAMS, _RATE_HZ, _ASKED_HZ = 1081, 40.0, 100.0
_STEP_RAD = 2 * math.pi / 4096


@dataclass(frozen=True, slots=True, eq=False)
class Turning:
    """A servo that turns, and the lidar on it.

    Attributes:
        speed_deg_s: mean speed.
        log: what its encoder said.
        scans: what the lidar saw.
    """

    speed_deg_s: float
    log: JointLog
    scans: list[Scan]

    def true_rad(self, time_ns: np.ndarray) -> Floats:
        """The angle that the encoder rounds."""
        turned = math.radians(self.speed_deg_s) * (time_ns - START_NS) / 1e9
        return turned + 0.01 * np.sin(turned + 0.7) + 0.003 * np.sin(3 * turned + 2.1)

    def in_order(self) -> Iterator[Scan | JointSample]:
        """Everything as it came: a scan when its last beam has been measured."""
        angles = map(JointSample, self.log.time_ns.tolist(), self.log.position_rad.tolist())
        things = [(one.time_ns, one) for one in angles] + [(int(scan.time_ns[-1]), scan) for scan in self.scans]
        return (thing for _, thing in sorted(things, key=lambda pair: pair[0]))


def turning(speed_deg_s: float, seconds: float, seed: int = 0) -> Turning:
    """A servo and a lidar for a while; the ranges are of no scene, since only angles and costs are looked at."""
    rng = np.random.default_rng(seed)
    asked_s = np.arange(round(seconds * _ASKED_HZ)) / _ASKED_HZ
    asked_s[1:] += rng.uniform(-0.3, 0.3, asked_s.size - 1) / _ASKED_HZ
    asked_ns = START_NS + np.rint(asked_s * 1e9).astype(np.int64)
    scans = [
        Scan(
            stamp_ns=START_NS + round((k + 0.5) / _RATE_HZ * 1e9),
            angle_min_rad=-2.356,
            angle_increment_rad=4.712 / (_BEAMS - 1),
            time_increment_s=0.01875 / (_BEAMS - 1),
            scan_time_s=1 / _RATE_HZ,
            range_min_m=0.1,
            range_max_m=30.0,
            range_m=rng.uniform(0.2, 29, _BEAMS).astype(np.float32),
            intensity=np.empty(0, np.float32),
        )
        for k in range(round((seconds - 1) * _RATE_HZ))
    ]
    found = Turning(speed_deg_s, JointLog(asked_ns, np.zeros(asked_ns.size)), scans)
    steps = np.rint(found.true_rad(asked_ns) / _STEP_RAD) * _STEP_RAD
    return Turning(speed_deg_s, JointLog(asked_ns, steps), scans)


def placed(scanner: Turning, look_ahead_s: float) -> list[ScanPoints]:
    """All scans through an assembler."""
    assembler = Assembler(ANGLES, look_ahead_s=look_ahead_s)
    return [line for thing in scanner.in_order() for line in assembler.push(thing)] + assembler.finish()


def _cost(seconds: float) -> None:
    placed(turning(20.0, 5.0), LOOK_AHEAD_S)  # compiles
    things = list(turning(20.0, seconds).in_order())
    assembler = Assembler(ANGLES)
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began_s, slowest_s, points = time.process_time(), 0.0, 0
    for thing in things:
        push_s = time.thread_time()
        points += sum(line.points_m.shape[0] for line in assembler.push(thing))
        slowest_s = max(slowest_s, time.thread_time() - push_s)
    spent_s = time.process_time() - began_s
    grown_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb
    cad = sorted({"cad", "cadquery", "OCP"} & {name.split(".")[0] for name in sys.modules})
    print(f"{seconds:.0f} s of 40 scans/s and 100 angles/s, {points:,} beams placed:")
    print(f"  {spent_s / seconds:.2%} of one core; slowest push {slowest_s * 1e3:.1f} ms")
    print(f"  memory grew by {grown_kb / 1e3:.1f} MB; CAD packages loaded: {', '.join(cad) or 'none'}")


def _rms_mdeg(off_rad: Floats) -> float:
    return float(np.degrees(np.sqrt(np.nanmean(off_rad**2))) * 1e3)


def _errors(seconds: float) -> None:
    print("axis angle, rms error in 0.001 deg against the truth (and as stated)")
    print(f"{'look-ahead':>12}" + "".join(f"{f'{speed} deg/s':>18}" for speed in (20, 60, 180)))
    scanners = [turning(speed, seconds) for speed in (20.0, 60.0, 180.0)]
    for look_ahead_s in (0.1, 0.2, 0.35, 0.5, 1.0):
        row = f"{look_ahead_s:>10} s"
        for scanner in scanners:
            lines = placed(scanner, look_ahead_s)
            off = np.concatenate([line.joint_rad - scanner.true_rad(line.scan.time_ns) for line in lines])
            stated = _rms_mdeg(np.array([line.axis_error_rad for line in lines]))
            row += f"{f'{_rms_mdeg(off):.2f} ({stated:.2f})':>18}"
        print(row)
    for name, curve_of in (("straight", straight), ("all of it", lambda log: axis_curve(log, at_rest=False)[0])):
        row = f"{name:>12}"
        for scanner in scanners:
            curve = curve_of(scanner.log)
            time_ns = np.concatenate([scan.time_ns for scan in scanner.scans])
            row += f"{_rms_mdeg(curve.angle_at(time_ns) - scanner.true_rad(time_ns)):>18.2f}"
        print(row)


def main() -> None:
    """Print both tables."""
    _cost(60.0)
    _errors(30.0)


if __name__ == "__main__":
    main()

"""What happens when something goes wrong during a scan, on the twins.

    uv run python -m benchmarks.firmware_io.faults [RUNS] [FAULT...]

Each run is a scan of the emulated scanner (a UTM-30LX that an MX-64R spins at 180 deg/s, protocol 1.0, or the servo or
lidar that a fault names: "stall, STS3215", "garbage, STL27L") which the fault hits a moment after the recording began.
Measured are: what was raised; after which time the servo stood, also where it turns on later; how much of the recording
before the fault is missing after `scanwright repair`; and, where the scan goes on, after which time (from the re-plug)
scans are recorded again. Times are those of this machine; the bounds to hold are 1 s of recording and 3 s to recover.
"""

from __future__ import annotations

import argparse
import math
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Timer

from scanwright.design.angles import AngleSet
from scanwright.design.errors import ScanwrightError
from scanwright.firmware_io.emulators.scanner import EmulatedScanner, emulated_scanner
from scanwright.firmware_io.emulators.world import room
from scanwright.firmware_io.recording.recording import open_recording
from scanwright.firmware_io.recording.repair.repair import repair
from scanwright.firmware_io.scan import acquire
from scanwright.firmware_io.scan.plan import plan_scan

ANGLES = AngleSet.model_validate(
    {
        "task": "faults",
        "angles_deg": {"alpha_rot": 0, "beta_rot": -55, "alpha_laser": -80, "beta_laser": 75},
        "sensor": "UTM-30LX",
        "servo": "MX-64R",
        "motion": {"mode": "spin", "period_s": 2.0},
    }
)
AFTER_S = 0.7  # from the beginning of the recording to the fault
AWAY_S = 0.5  # how long something is unplugged
PATIENCE_S = 3.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """One run; NaN where a time does not apply or never came."""

    ended: str
    stands_s: float
    lost_s: float
    back_s: float


class TooBusyError(Exception):
    """The scan failed before the fault: this computer has no time for twins."""


Fault = Callable[[EmulatedScanner], object]


def replugged_lidar(twins: EmulatedScanner) -> None:
    """Pull the lidar's plug and put it back."""
    twins.lidar.unplug()
    Timer(AWAY_S, twins.lidar.plug).start()


def garbage(twins: EmulatedScanner) -> None:
    """Flip bits, cut and merge lines of both devices."""
    twins.lidar.garble(10)
    twins.lidar.cut(10)
    twins.servo.bit_errors(2e-3)


INSIDE: dict[str, Fault] = {
    "servo unplugged": lambda twins: twins.servo.unplug(),
    "lidar unplugged": lambda twins: twins.lidar.unplug(),
    "lidar unplugged and back": replugged_lidar,
    "stall": lambda twins: twins.servo.stall(),
    "garbage": garbage,
    "servo brown-out": lambda twins: twins.servo.brown_out(),
    "lidar brown-out": lambda twins: twins.lidar.power_cycle(),
}
SIGNALS = {"kill -9": signal.SIGKILL, "Ctrl-C": signal.SIGINT}
FULL_DISK = "full disk"
SERVOS = {  # model and protocol
    "protocol 1.0": ("MX-64R", "1.0"),
    "protocol 2.0": ("MX-64R", "2.0"),
    "XL430-W250": ("XL430-W250", "2.0"),
    "STS3215": ("STS3215", "STS"),
}
LIDARS = ("STL27L", "RPLIDAR A2", "TiM561", "LMS 200")  # one of each family
ALL = [
    *("servo unplugged, protocol 1.0", "servo unplugged, protocol 2.0"),
    *[name for name in (*INSIDE, *SIGNALS, FULL_DISK) if name != "servo unplugged"],
    *[
        f"{name}, {servo}"
        for servo in ("XL430-W250", "STS3215")
        for name in ("servo unplugged", "stall", "garbage", "servo brown-out", "kill -9")
    ],
    *[
        f"{name}, {lidar}"
        for lidar in LIDARS
        for name in ("lidar unplugged", "lidar unplugged and back", "stall", "garbage", "lidar brown-out", "kill -9")
    ],
]


def stands_after_s(twins: EmulatedScanner, since_s: float, over: Event | None = None) -> float:
    """Time from `since_s` until the horn stands; NaN if it does not in `PATIENCE_S`, or until all is over."""
    given_up_s = time.monotonic() + PATIENCE_S
    while abs(twins.servo.axis.motion(time.monotonic_ns()).rate_rad_s) > 0.02:
        if time.monotonic() > given_up_s or (over is not None and over.is_set()):
            return float("nan")
        time.sleep(0.01)
    return time.monotonic() - since_s


def inside(out: Path, twins: EmulatedScanner, fault: Fault) -> Outcome:
    """A fault of the devices, with the scan in this process."""
    hit: list[tuple[float, int]] = []
    stood: list[float] = []
    scanned = Event()

    def strike() -> None:
        hit.append((time.monotonic(), time.time_ns()))
        fault(twins)
        stood.append(stands_after_s(twins, hit[0][0], scanned))

    timer = Timer(AFTER_S, strike)

    def progress(step: str, fraction: float | None = None) -> None:
        if step.startswith("recording") and fraction is None:
            timer.start()

    plan = plan_scan(out, turns=3, lidar=twins.ports.lidar, servo=twins.ports.servo)
    try:
        acquire.acquire(plan, progress)
        ended = "goes on"
        scanned.set()
    except ScanwrightError as error:
        if not hit:
            raise TooBusyError from error
        ended = type(error).__name__
    timer.join()
    lost_s = max(hit[0][1] - repair(plan.recording).times_ns[1], 0) / 1e9
    if ended != "goes on":
        return Outcome(ended, stood[0], lost_s, float("nan"))
    stamps_ns = open_recording(plan.recording).stamp_ns
    came = stamps_ns[stamps_ns > hit[0][1] + round(AWAY_S * 1e9)]
    return Outcome(ended, stood[0], lost_s, (int(came[0]) - hit[0][1]) / 1e9 - AWAY_S)


def outside(out: Path, twins: EmulatedScanner, number: int | None) -> Outcome:
    """A scan in a process of its own that gets a signal; without one, its disk is full at 400 kB."""
    words = ["--lidar", twins.ports.lidar, "--servo", twins.ports.servo, "--turns", "50"]
    limit = None if number else lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))
    with subprocess.Popen(
        [sys.executable, "-m", "scanwright", "scan", str(out), *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=limit,
    ) as process:
        while not any(path.stat().st_size > 100_000 for path in (out / "recordings").glob("*.mcap")):
            if process.poll() is not None:
                raise TooBusyError(process.communicate()[1].strip())
            time.sleep(0.01)
        if number:
            process.send_signal(number)
            hit_ns = time.time_ns()
        else:
            process.wait()
            (recording,) = (out / "recordings").glob("*.mcap")
            hit_ns = recording.stat().st_mtime_ns  # the write that did not fit
        stands_s = stands_after_s(twins, time.monotonic() - (time.time_ns() - hit_ns) / 1e9)
        process.communicate()
    (recording,) = (out / "recordings").glob("*.mcap")
    lost_s = max(hit_ns - repair(recording).times_ns[1], 0) / 1e9
    typed = "one line, exit 2" if process.returncode == 2 else f"exit {process.returncode}"
    return Outcome(typed, stands_s, lost_s, float("nan"))


def trial(name: str, seed: int) -> Outcome:
    """One run of one fault with a fresh scanner."""
    fault, _, device = name.partition(", ")
    lidar = device if device in LIDARS else ANGLES.sensor
    model, protocol = SERVOS[device if device in SERVOS else "protocol 1.0"]
    angles = ANGLES.model_copy(update={"servo": model, "sensor": lidar})
    with (
        tempfile.TemporaryDirectory() as folder,
        emulated_scanner(angles, room(None), protocol=protocol, seed=seed) as twins,
    ):
        out = Path(folder)
        (out / "angles.json").write_text(angles.to_json(), encoding="utf-8")
        return inside(out, twins, INSIDE[fault]) if fault in INSIDE else outside(out, twins, SIGNALS.get(fault))


def trials(name: str, runs: int) -> list[Outcome]:
    """So many runs of one fault; those that failed before it do not count, and are told."""
    outcomes: list[Outcome] = []
    seed = 0
    while len(outcomes) < runs:
        try:
            outcomes.append(trial(name, seed))
        except TooBusyError as busy:
            print(
                f"not counted: {name}, seed {seed}: failed before the fault: {busy.__cause__ or busy}", file=sys.stderr
            )
        seed += 1
    return outcomes


def row(name: str, outcomes: list[Outcome]) -> str:
    """One line of the table."""
    ended = ", ".join(sorted({outcome.ended for outcome in outcomes}))

    def worst(values: list[float]) -> str:
        known = [value for value in values if not math.isnan(value)]
        never = f"never ({len(values) - len(known)})" if len(known) < len(values) else ""
        return ", ".join([*([f"{max(known):.2f} s"] if known else []), *([never] if never else [])])

    turns_on = ended == "goes on" and all(math.isnan(o.stands_s) for o in outcomes)
    stands = "turns on" if turns_on else worst([o.stands_s for o in outcomes])
    back = worst([o.back_s for o in outcomes]) if "goes on" in ended else "-"
    return f"| {name} | {len(outcomes)} | {ended} | {stands} | {worst([o.lost_s for o in outcomes])} | {back} |"


def main() -> None:
    """Run every fault, or those that are named, as often as asked for, and print a table of the worst cases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="?", type=int, default=100, help="of each fault; 100 if nothing else is said")
    parser.add_argument("fault", nargs="*", help=f"all if none is named: {'; '.join(ALL)}")
    asked = parser.parse_args()
    with suppress(PermissionError):
        os.nice(-10)  # twins need their time, as hardware does not
    print("| fault | runs | ends with | servo stands after | recording lost | scans again after |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name in asked.fault or ALL:
        print(row(name, trials(name, asked.runs)), flush=True)


if __name__ == "__main__":
    main()

"""What driving costs: `python -m benchmarks.firmware_io.driver [SECONDS]`.

The emulated scanner (a UTM-30LX, 40 scans a second with intensities, on an MX-64R that is asked a hundred times a
second) runs in a process of its own; here everything runs that `scanwright scan` does while it records. Printed are the
processor time of this process beside the time that passed, and how its memory grew, from one second into the recording
on. The bound to hold is a fifth of one core, and no growth.
"""

from __future__ import annotations

import resource
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.firmware_io.faults import ANGLES
from scanwright.firmware_io.scan import acquire
from scanwright.firmware_io.scan.plan import plan_scan

_SETTLED_S = 10.0  # of recording, in which buffers come to their size
_PAGE = resource.getpagesize()


@dataclass(frozen=True, slots=True)
class _Reading:
    """What the process has used until one moment."""

    wall_s: float
    processor_s: float
    memory_bytes: int

    @staticmethod
    def now() -> _Reading:
        resident = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return _Reading(time.monotonic(), time.process_time(), resident * _PAGE)


def main() -> None:
    """Scan for a while, and print what it cost."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        (out / "angles.json").write_text(ANGLES.to_json(), encoding="utf-8")
        with subprocess.Popen(
            [sys.executable, "-m", "scanwright", "emulate", str(out)], stdout=subprocess.DEVNULL
        ) as twins:
            try:
                while not (out / "emulated.json").exists():
                    if twins.poll() is not None:
                        raise SystemExit("the twins did not start")
                    time.sleep(0.05)
                _drive(out, seconds)
            finally:
                twins.send_signal(signal.SIGTERM)


def _drive(out: Path, seconds: float) -> None:
    turns = round(seconds / ANGLES.motion.duration_s) if ANGLES.motion else 1
    plan = replace(plan_scan(out, turns=turns), intensity=True)
    readings: list[_Reading] = []

    def progress(_step: str, fraction: float | None = None) -> None:
        if fraction is not None:  # once a second, while it records
            readings.append(_Reading.now())

    summary = acquire.acquire(plan, progress)
    settled = [one for one in readings if one.wall_s - readings[0].wall_s >= min(_SETTLED_S, seconds / 2)]
    first, last = settled[0], settled[-1]
    share = (last.processor_s - first.processor_s) / (last.wall_s - first.wall_s)
    rate_hz = summary.scans / summary.duration_s
    uncertain = summary.left_out.get("servo angles with uncertain timestamp", 0)
    asked_hz = (summary.joint_samples + uncertain) / summary.duration_s
    print(f"{summary.duration_s:.0f} s of {rate_hz:.1f} scans/s with intensities and {asked_hz:.0f} servo reads/s:")
    print(f"  {share:.1%} of one core over the last {last.wall_s - first.wall_s:.0f} s")
    print(f"  memory {first.memory_bytes / 1e6:.1f} MB, then {last.memory_bytes / 1e6:.1f} MB at the end")


if __name__ == "__main__":
    main()

"""Soak test of the ROS 2 node on emulators: memory, lost scans, killed listeners, devices that go and come.

    python -m benchmarks.firmware_io.devices.soak MINUTES ROS_PYTHON

ROS_PYTHON has rclpy and scanwright. A row each 30 s: resident memory of the node, scans heard, and the largest gap
between two stamps (0.1 s and what the sensor's turn wanders: none is lost). After every second row the listener is
killed (-9) and another one comes; in the middle the emulators stand still for 12 s, as devices that are unplugged.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from threading import Thread

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.motion import Spin

ROW_S = 30.0
AWAY_S = 12.0
ANGLES = AngleSet(
    task="soak",
    angles_deg=Angles(alpha_rot=10, beta_rot=-30, alpha_laser=60, beta_laser=20),
    sensor="URG-04LX",
    servo="MX-64R",
    motion=Spin(period_s=5.0),
)
_LISTENER = Path(__file__).with_name("soak_listener.py")


class Listener:
    """A program that listens, and what it said."""

    def __init__(self, python: str, env: dict[str, str]) -> None:
        """Start it."""
        self._process = subprocess.Popen([python, str(_LISTENER)], env=env, stdout=subprocess.PIPE, text=True)
        self._said: list[tuple[int, float]] = []
        Thread(target=self._read, daemon=True).start()

    def take(self) -> tuple[int, float]:
        """Scans so far, and the largest gap [s] since last asked."""
        said, self._said = self._said, []
        return (said[-1][0] if said else 0), max((gap_s for _, gap_s in said), default=float("nan"))

    def kill(self) -> None:
        """As a crash does."""
        self._process.kill()
        self._process.wait()

    def _read(self) -> None:
        for line in self._process.stdout or ():
            count, gap_s = line.split()
            self._said.append((int(count), float(gap_s)))


def resident_mb(pid: int) -> float:
    """Resident memory of a process; NaN where it has ended."""
    status = Path(f"/proc/{pid}/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS")), float("nan"))


def soak(minutes: float, python: str) -> None:
    """Print the table."""
    env = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": str(100 + os.getpid() % 100)}
    rows = max(round(60 * minutes / ROW_S), 3)
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        Path(folder, "angles.json").write_text(ANGLES.to_json(), encoding="utf-8")
        emulators = _started(stack, [sys.executable, "-m", "scanwright", "emulate", folder], env)
        while not Path(folder, "emulated.json").exists() and emulators.poll() is None:
            time.sleep(0.1)
        node = _started(stack, [python, "-m", "scanwright", "ros2", folder, "--straight"], env)
        listener = Listener(python, env)
        stack.callback(lambda: listener.kill())  # the one of then
        print("minutes  memory_mb  scans  largest_gap_s  what")
        for row in range(1, rows + 1):
            time.sleep(ROW_S)
            scans, gap_s = listener.take()
            what = ""
            if row == rows // 2:
                what = "devices away for 12 s from here"
                emulators.send_signal(signal.SIGSTOP)
                time.sleep(AWAY_S)
                emulators.send_signal(signal.SIGCONT)
            elif row % 2 == 0:
                what = "listener killed"
                listener.kill()
                listener = Listener(python, env)
            state = "" if node.poll() is None else f"the node has ended with {node.returncode}"
            place = f"{row * ROW_S / 60:7.1f}  {resident_mb(node.pid):9.1f}  {scans:5}  {gap_s:13.3f}"
            print(f"{place}  {what}{state}", flush=True)


def _started(stack: ExitStack, words: list[str], env: dict[str, str]) -> subprocess.Popen[bytes]:
    process = subprocess.Popen(words, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def end() -> None:
        process.send_signal(signal.SIGINT)
        process.wait()

    stack.callback(end)
    return process


if __name__ == "__main__":
    soak(float(sys.argv[1]), sys.argv[2])

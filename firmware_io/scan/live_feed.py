"""Scans for a live view, placed as by `assemble`.

The reading thread appends to two short queues; another thread sends them five times a second to a separate process
that computes points. A slow viewer loses its oldest scans, which are counted; the recording loses nothing.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from threading import Event, Lock, Thread
from typing import Protocol

import numpy as np
from jaxtyping import Float32, Float64, Int64
from numpy import ndarray

from scanwright.design.angles import AngleSet
from scanwright.design.progress import Progress, no_progress
from scanwright.firmware_io.assembly.beam_outcome import Verdict
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.assembly.streaming import Assembler
from scanwright.firmware_io.samples import JointSample, Scan
from scanwright.firmware_io.scan.scan_end import ScanEnd

MOST_SCANS = 400  # ten seconds at 40 Hz, the start of the page on a busy computer
MOST_ANGLES = 2000  # 20 s at 100 Hz
EVERY_S = 0.2  # five times a second looks continuous
_log = logging.getLogger(__name__)


class Watch(Protocol):
    """Receiver of a recording while it is made; its methods must not block."""

    def joint(self, time_ns: int, position_rad: float) -> None:
        """Receive an angle of the servo."""

    def scan(self, scan: Scan) -> None:
        """Receive a scan whose last beam is not later than the last angle."""

    def message(self, line: str) -> None:
        """Receive a line of progress, or a warning."""

    def close(self) -> None:
        """End the recording."""


class Viewer(Watch, Protocol):
    """A `Watch` that also shows how the scan ended."""

    def ended(self, end: ScanEnd) -> None:
        """Receive the end of the scan; the last call before `close`."""


class Unwatched(Viewer):
    """The `Viewer` of a recording without viewers."""


UNWATCHED = Unwatched()  # type: ignore[abstract]  # the empty bodies of `Viewer` are its implementation


@dataclass(frozen=True, slots=True)
class Reporter:
    """Messages of a scan: progress for the caller, warnings for the log, both for live viewers."""

    progress: Progress = no_progress
    watch: Watch = UNWATCHED

    def step(self, text: str, fraction: float | None = None) -> None:
        """Report a step, and its completed fraction."""
        self.progress(text, fraction)
        self.watch.message(text if fraction is None else f"{fraction:.0%}: {text}")

    def warn(self, text: str) -> None:
        """Report a warning."""
        _log.warning("%s", text)
        self.watch.message(f"warning: {text}")


@dataclass(frozen=True, slots=True)
class Both:
    """The `Watch` of two; if the first raises, the second receives nothing."""

    first: Watch
    second: Watch

    def joint(self, time_ns: int, position_rad: float) -> None:
        """See `Watch`."""
        self.first.joint(time_ns, position_rad)
        self.second.joint(time_ns, position_rad)

    def scan(self, scan: Scan) -> None:
        """See `Watch`."""
        self.first.scan(scan)
        self.second.scan(scan)

    def message(self, line: str) -> None:
        """See `Watch`."""
        self.first.message(line)
        self.second.message(line)

    def close(self) -> None:
        """See `Watch`."""
        self.first.close()
        self.second.close()


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """Data since the last batch."""

    time_ns: Int64[ndarray, " n"]  # of the angles, shape (n,)
    position_rad: Float64[ndarray, " n"]
    scans: tuple[Scan, ...]
    lines: tuple[str, ...]
    lost: int  # scans that the view has dropped so far
    end: ScanEnd | None = None


class Feed:
    """The `Viewer` that sends batches through a pipe."""

    def __init__(self, sending: Connection) -> None:
        self.lost = 0
        self.end: ScanEnd | None = None
        self._sending = sending
        self._joints: deque[tuple[int, float]] = deque(maxlen=MOST_ANGLES)
        self._scans: deque[Scan] = deque(maxlen=MOST_SCANS)
        self._lines: deque[str] = deque(maxlen=8)
        self._lock, self._done = Lock(), Event()
        self._thread = Thread(target=self._send, name="live", daemon=True)
        self._thread.start()

    def joint(self, time_ns: int, position_rad: float) -> None:
        """See `Watch`."""
        with self._lock:
            self._joints.append((time_ns, position_rad))

    def scan(self, scan: Scan) -> None:
        """See `Watch`."""
        with self._lock:
            self.lost += len(self._scans) == MOST_SCANS
            self._scans.append(scan)

    def message(self, line: str) -> None:
        """See `Watch`."""
        with self._lock:
            self._lines.append(line)

    def ended(self, end: ScanEnd) -> None:
        """See `Viewer`."""
        with self._lock:
            self.end = end

    def close(self) -> None:
        """Send the rest, for at most 2 s, and close the pipe."""
        self._done.set()
        self._thread.join(timeout=2.0)
        self._sending.close()

    def _batch(self) -> Batch:
        with self._lock:
            joints, scans, lines = list(self._joints), tuple(self._scans), tuple(self._lines)
            self._joints.clear()
            self._scans.clear()
            self._lines.clear()
        times = np.array([time_ns for time_ns, _ in joints], np.int64)
        return Batch(times, np.array([angle for _, angle in joints], float), scans, lines, self.lost, self.end)

    def _send(self) -> None:
        last = False
        while not last:
            last = self._done.wait(EVERY_S)
            try:
                self._sending.send(self._batch())
            except OSError:  # the viewer was closed: the scan continues
                return


@dataclass(frozen=True, slots=True, eq=False)
class CloudGrowth:
    """New points of a cloud."""

    points_m: Float32[ndarray, "n 3"]  # in the world
    intensity: Float32[ndarray, " n"]  # 0 from a sensor that measures none
    time_s: Float32[ndarray, " n"]  # of the scan of each point, since the first scan
    lines: tuple[str, ...]  # new messages
    lost: int  # scans that the view has dropped so far
    end: ScanEnd | None = None  # None while the scan runs


class Placing:
    """Converter of batches to points by `Assembler`, with linear interpolation of the axis, so that no scan waits."""

    def __init__(self, angles: AngleSet, own_body: OwnBody | None) -> None:
        self._assembler = Assembler(angles, own_body=own_body, smooth=False)
        self._first_ns: int | None = None

    def place(self, batch: Batch) -> CloudGrowth:
        """Return the points of the scans of a batch."""
        angles = map(JointSample, batch.time_ns.tolist(), batch.position_rad.tolist())
        messages: list[JointSample | Scan] = [*angles, *batch.scans]
        placed = [line for message in messages for line in self._assembler.push(message)]
        points = [np.empty((0, 3), np.float32)]
        intensity, seconds = [np.empty(0, np.float32)], [np.empty(0, np.float32)]
        for line in placed:
            if self._first_ns is None:
                self._first_ns = line.scan.stamp_ns
            there = line.verdict == Verdict.POINT
            points.append(line.points_m[there])
            measured = line.scan.intensity if line.scan.intensity.size else np.zeros_like(line.scan.range_m)
            intensity.append(measured[there])
            after_s = np.float32((line.scan.stamp_ns - self._first_ns) / 1e9)
            seconds.append(np.full(len(points[-1]), after_s))
        return CloudGrowth(
            np.concatenate(points),
            np.concatenate(intensity),
            np.concatenate(seconds),
            batch.lines,
            batch.lost,
            batch.end,
        )


def batches(receiving: Connection) -> Iterator[Batch]:
    """Yield the batches from the pipe until the other end is closed."""
    while True:
        try:
            batch = receiving.recv()
        except (EOFError, OSError):  # OSError: the sender was killed in a message
            return
        yield batch


def growing(receiving: Connection, placing: Placing) -> Iterator[CloudGrowth]:
    """Yield the points of the batches from the pipe until the other end is closed."""
    return map(placing.place, batches(receiving))

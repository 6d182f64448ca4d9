"""Replay of a recording in real time to a `Watch`."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from heapq import merge
from pathlib import Path

from scanwright.design.errors import RecordingError
from scanwright.design.findings import sentence
from scanwright.firmware_io.recording.import_checks.stream import StreamChecks
from scanwright.firmware_io.recording.recording import Recording, open_recording
from scanwright.firmware_io.samples import JointSample, Scan
from scanwright.firmware_io.scan.live_feed import Reporter, Watch


def replay(
    path: Path, watch: Watch, *, rate: float = 1.0, wait_until: Callable[[float], None] | None = None
) -> tuple[int, int]:
    """Replay a recording as `acquire` publishes a scan, after the angle after its last beam, with its checks.

    `watch` receives scans, angles, and warnings of the checks; its `close` is not called. `wait_until` waits until so
    many seconds after the start; None for the clock of this computer.

    Returns:
        Number of scans and number of angles published.

    Raises:
        RecordingError: the recording is unreadable, or the rate is invalid.
    """
    if not 0 < rate < math.inf:
        raise RecordingError(f"rate = {rate}: must be above 0 and finite")
    began_s = time.monotonic()
    wait = wait_until or (lambda after_s: time.sleep(max(began_s + after_s - time.monotonic(), 0.0)))
    waiting: deque[Scan] = deque()
    scans = angles = 0
    begin_ns: int | None = None
    source = open_recording(path)
    checks, reporter = StreamChecks(at_rest=source.at_rest), Reporter(watch=watch)

    def hand_over(scan: Scan) -> None:
        watch.scan(scan)
        for finding in checks.scan(scan):
            reporter.warn(sentence(finding))

    for thing in _in_order(source):
        if isinstance(thing, Scan):
            waiting.append(thing)
            continue
        begin_ns = thing.time_ns if begin_ns is None else begin_ns
        wait((thing.time_ns - begin_ns) / 1e9 / rate)
        watch.joint(thing.time_ns, thing.position_rad)
        checks.joint(thing.time_ns, thing.position_rad)
        angles += 1
        while waiting and waiting[0].time_ns[-1] <= thing.time_ns:
            hand_over(waiting.popleft())
            scans += 1
    for scan in waiting:  # after the last angle
        hand_over(scan)
        scans += 1
    for finding in checks.check():
        reporter.warn(sentence(finding))
    return scans, angles


def _in_order(source: Recording) -> Iterator[Scan | JointSample]:
    """Yield scans by their stamps and angles by their times, in order."""
    log = source.joint_log
    angles = (JointSample(*pair) for pair in zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True))
    return merge(angles, source.scans(), key=lambda item: item.stamp_ns if isinstance(item, Scan) else item.time_ns)

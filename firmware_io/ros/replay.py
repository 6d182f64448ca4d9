"""A recording at its own pace, told to whoever would watch the scan itself."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from heapq import merge
from pathlib import Path

from scanwright.design.errors import RecordingError
from scanwright.firmware_io.recording.recording import open_recording
from scanwright.firmware_io.samples import JointSample, Scan
from scanwright.firmware_io.scan.live_feed import Watch


def replay(
    path: Path, watch: Watch, *, rate: float = 1.0, wait_until: Callable[[float], None] | None = None
) -> tuple[int, int]:
    """Tell a recording as `acquire` tells a scan: a scan when the angle after its last beam is known.

    Args:
        path: the recording.
        watch: who is told; its `close` is not called.
        rate: how many times as fast as it was recorded.
        wait_until: waits until so many seconds after the start; None for the clock of this computer.

    Returns:
        Number of scans and number of angles published.

    Raises:
        RecordingError: the recording is unreadable, or the rate is none.
    """
    if not 0 < rate < math.inf:
        raise RecordingError(f"rate = {rate}: must be above 0 and finite")
    wait = wait_until or _clock()
    waiting: deque[Scan] = deque()
    scans = angles = 0
    begin_ns: int | None = None
    for thing in _in_order(path):
        if isinstance(thing, Scan):
            waiting.append(thing)
            continue
        begin_ns = thing.time_ns if begin_ns is None else begin_ns
        wait((thing.time_ns - begin_ns) / 1e9 / rate)
        watch.joint(thing.time_ns, thing.position_rad)
        angles += 1
        while waiting and waiting[0].time_ns[-1] <= thing.time_ns:
            watch.scan(waiting.popleft())
            scans += 1
    for scan in waiting:  # the servo was silent before the lidar was
        watch.scan(scan)
        scans += 1
    return scans, angles


def _in_order(path: Path) -> Iterator[Scan | JointSample]:
    """Scans by their stamps and angles by their times, one after the other."""
    source = open_recording(path)
    log = source.joint_log
    angles = (JointSample(*pair) for pair in zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True))
    return merge(angles, source.scans(), key=lambda one: one.stamp_ns if isinstance(one, Scan) else one.time_ns)


def _clock() -> Callable[[float], None]:
    began_s = time.monotonic()
    return lambda after_s: time.sleep(max(began_s + after_s - time.monotonic(), 0.0))

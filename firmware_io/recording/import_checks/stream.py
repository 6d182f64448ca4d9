"""Import checks on a stream of scans and angles, over a sliding window; each kind of finding is reported once."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from scanwright.design.arrays import Floats, Times
from scanwright.design.findings import Finding
from scanwright.firmware_io.recording.bag_clocks import Stamps
from scanwright.firmware_io.recording.import_checks.angles import angle_findings, usual_speed_rad_s
from scanwright.firmware_io.recording.import_checks.clocks import clock_findings
from scanwright.firmware_io.recording.import_checks.headers import Headers, header_findings, header_of_scan
from scanwright.firmware_io.samples import JointLog, Scan

WINDOW_S = 20.0
EVERY_S = 5.0
_UNKNOWN = -1  # receive time
_LEAST = 20  # scans and angles, for medians


class StreamChecks:
    """Checks of scans and angles on one clock; `at_rest`: the axis rests during each scan."""

    def __init__(self, *, at_rest: bool) -> None:
        self._at_rest = at_rest
        self._headers: deque[tuple[float, ...]] = deque()
        self._received_ns: deque[int] = deque()
        self._angles: deque[tuple[int, float]] = deque()
        self._reported: set[str] = set()
        self._checked_ns: int | None = None

    def joint(self, time_ns: int, position_rad: float) -> None:
        """Add an angle."""
        self._angles.append((time_ns, position_rad))
        while time_ns - self._angles[0][0] > WINDOW_S * 1e9:
            self._angles.popleft()

    def scan(self, scan: Scan, received_ns: int | None = None) -> list[Finding]:
        """Add a scan, in the order of receipt; every `EVERY_S` return the new findings."""
        self._headers.append(header_of_scan(scan))
        self._received_ns.append(_UNKNOWN if received_ns is None else received_ns)
        while scan.stamp_ns - self._headers[0][0] > WINDOW_S * 1e9:
            self._headers.popleft()
            self._received_ns.popleft()
        if self._checked_ns is None:
            self._checked_ns = scan.stamp_ns
        if scan.stamp_ns - self._checked_ns < EVERY_S * 1e9:
            return []
        self._checked_ns = scan.stamp_ns
        return self.check()

    def check(self) -> list[Finding]:
        """Return the new findings of the window."""
        if min(len(self._headers), len(self._angles)) < _LEAST:
            return []
        new = [
            finding
            for finding in self._findings()
            if finding.severity in ("warning", "error") and finding.code not in self._reported
        ]
        self._reported.update(finding.code for finding in new)
        return new

    def _findings(self) -> Iterator[Finding]:
        headers = Headers.of(self._headers)
        time_ns, position_rad = (np.array(column) for column in zip(*self._angles, strict=True))
        unique_ns, first = np.unique(time_ns, return_index=True)
        received_ns = np.array(self._received_ns, np.int64)
        prompt_ns = headers.stamp_ns + headers.judged().arc_ns  # causes no finding
        return sample_findings(
            headers,
            Stamps(headers.stamp_ns, np.where(received_ns == _UNKNOWN, prompt_ns, received_ns)),
            Stamps(time_ns, time_ns),
            time_ns,
            position_rad,
            0.0 if self._at_rest else usual_speed_rad_s(JointLog(unique_ns, position_rad[first])),
            at_rest=self._at_rest,
            same_clock=True,
        )


def sample_findings(
    headers: Headers,
    scans: Stamps,
    angles: Stamps,
    angle_ns: Times,
    position_rad: Floats,
    speed_rad_s: float,
    *,
    at_rest: bool,
    same_clock: bool,
    dropped: bool = False,
    stamped: bool = True,
    timed: bool = True,
) -> Iterator[Finding]:
    """Check scans and angles of a recording or a stream.

    `angle_ns` are the times that the angles get, shape (n,); `stamped`: the times of the scans are their stamps; the
    others are as in `angle_findings` and `clock_findings`.
    """
    if not at_rest:
        order = np.argsort(angle_ns, kind="stable")
        yield from angle_findings(angle_ns[order], position_rad[order], dropped=dropped, timed=timed)
    yield from header_findings(headers, speed_rad_s)
    if stamped:
        yield from clock_findings(scans, angles, headers.judged().arc_ns, speed_rad_s, same_clock=same_clock)

"""Import checks on a stream of scans and angles, over a sliding window; each kind of finding is reported once."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from scanwright.design.findings import Finding
from scanwright.firmware_io.recording.bag_clocks import Stamps
from scanwright.firmware_io.recording.import_checks.angles import angle_findings, usual_speed_rad_s
from scanwright.firmware_io.recording.import_checks.clocks import clock_findings
from scanwright.firmware_io.recording.import_checks.headers import Headers, header_findings, header_of
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
        span_rad = scan.angle_increment_rad * (scan.range_m.size - 1)
        self._headers.append(header_of(scan, span_rad, scan.intensity.size))
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
        speed_rad_s = 0.0
        if not self._at_rest:
            order = np.argsort(time_ns, kind="stable")
            speed_rad_s = usual_speed_rad_s(JointLog(unique_ns, position_rad[first]))
            yield from angle_findings(time_ns[order], position_rad[order], dropped=False, timed=True)
        yield from header_findings(headers, speed_rad_s)
        received_ns, arc_ns = np.array(self._received_ns, np.int64), headers.judged().arc_ns
        # the receipt of the last beam causes no finding
        scans = Stamps(headers.stamp_ns, np.where(received_ns == _UNKNOWN, headers.stamp_ns + arc_ns, received_ns))
        yield from clock_findings(scans, Stamps(time_ns, time_ns), arc_ns, speed_rad_s, same_clock=True)

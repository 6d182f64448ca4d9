"""Choice of the clock of an imported bag, and the joint log on it.

Scans and angles must share a clock. Header stamps are better than receive times, but some messages have none, and some
sensors' clocks differ from the host's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64
from numpy import ndarray

from scanwright.design.arrays import Times
from scanwright.firmware_io.samples import JointLog

_SAME_CLOCK_NS = 1_000_000_000  # largest delay of a message stamped by the receiver's clock
_AHEAD_S = 0.05  # stamps later than this after their receipt are worse than receive times
_RECEIPT = ": both take the time they were received; a scan is received after its last beam, so expect a lag"


@dataclass(frozen=True, slots=True, eq=False)
class Stamps:
    """Times of the messages of one source, both shape (n,); a stamp is 0 if the message has none."""

    stamp_ns: Int64[ndarray, " n"]
    receive_ns: Int64[ndarray, " n"]

    def complete(self) -> bool:
        """Whether all messages have a stamp."""
        return bool((self.stamp_ns > 0).all())

    def on_host_clock(self) -> bool:
        """Whether the stamps can be of the receiver's clock."""
        delay_ns = self.receive_ns - self.stamp_ns
        return self.complete() and bool((np.abs(delay_ns) < _SAME_CLOCK_NS).all())


@dataclass(frozen=True, slots=True, eq=False)
class OneClock:
    """Scan and angle times on one clock; `note` is "" if both are header stamps, or a warning."""

    scan_ns: Int64[ndarray, " scans"]
    angle_ns: Int64[ndarray, " angles"]
    note: str


def one_clock(scans: Stamps, angles: Stamps, arc_ns: Int64[ndarray, " scans"]) -> OneClock:
    """Choose the times of scans and angles, each shape (n,).

    Stamps after their receipt are of another clock. If both sources share that clock, their stamps are used; otherwise
    the receive times, minus `arc_ns` for scans: the time from first to last beam.
    """
    ahead_s = [_ahead_s(stamps) if stamps.complete() else 0.0 for stamps in (scans, angles)]
    after_arc_s = ahead_s[0] + 1e-9 * float(np.median(arc_ns)) if len(arc_ns) else ahead_s[0]
    ahead = _AHEAD_S < max(ahead_s) < 1e-9 * _SAME_CLOCK_NS
    if ahead and abs(after_arc_s - ahead_s[1]) > _AHEAD_S and _overlap(scans.stamp_ns, angles.stamp_ns):
        subject = "scans" if ahead_s[0] >= ahead_s[1] else "angles"
        note = f"the stamps of {subject} lie {max(ahead_s):.3f} s after they were received: another clock"
        return OneClock(scans.receive_ns - arc_ns, angles.receive_ns, note + _RECEIPT)
    if scans.complete() and angles.complete() and _overlap(scans.stamp_ns, angles.stamp_ns):
        return OneClock(scans.stamp_ns, angles.stamp_ns, "")
    if scans.on_host_clock() and not angles.complete():
        note = "angles carry no stamp: they take the time they were received, which is late by their transport"
        return OneClock(scans.stamp_ns, angles.receive_ns, note)
    if not angles.complete() or not scans.complete():
        missing = "angles" if scans.complete() else "scans" if angles.complete() else "scans and angles"
        note = f"{missing} carry no stamp"
        if scans.complete():
            note += f", and the scans' stamps are from another clock (they start at {scans.stamp_ns[0] / 1e9:.0f} s)"
    else:
        note = (
            f"the stamps of scans (from {scans.stamp_ns[0] / 1e9:.0f} s) and angles (from "
            f"{angles.stamp_ns[0] / 1e9:.0f} s) have no time in common"
        )
    note += _RECEIPT
    return OneClock(scans.receive_ns, angles.receive_ns, note)


def log_at_rest(
    log: JointLog, begin_ns: Int64[ndarray, " scans"], arc_ns: Int64[ndarray, " scans"]
) -> tuple[JointLog, int]:
    """Return a log with one angle during each scan, and the number of scans cut short by the next one.

    The angle is the last one of `log` until the first beam; a scan before `log` gets no sample. `arc_ns`: time from
    first to last beam.
    """
    begin_ns, first = np.unique(begin_ns, return_index=True)
    known = (begin_ns >= log.time_ns[0]) & (begin_ns <= log.time_ns[-1])
    begin_ns, end_ns = begin_ns[known], (begin_ns + arc_ns[first])[known]
    angle_rad = log.position_rad[np.searchsorted(log.time_ns, begin_ns, side="right") - 1]
    latest_ns = np.append(begin_ns[1:] - 1, end_ns[-1:])
    both_ns = np.stack([begin_ns, np.minimum(end_ns, latest_ns)], axis=1).ravel()
    distinct = np.append(True, np.diff(both_ns) > 0)  # a scan without time_increment has no duration
    return JointLog(both_ns[distinct], np.repeat(angle_rad, 2)[distinct]), int(np.sum(end_ns > latest_ns))


def _ahead_s(stamps: Stamps) -> float:
    """Return the time by which stamps exceed their receipt, at the 5 % quantile of the delay; normally negative."""
    return -float(np.quantile(stamps.receive_ns - stamps.stamp_ns, 0.05)) / 1e9


def _overlap(a_ns: Times, b_ns: Times) -> bool:
    return bool(max(a_ns.min(), b_ns.min()) <= min(a_ns.max(), b_ns.max()))

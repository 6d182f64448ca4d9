"""Checks of the clocks of scans and angles, by stamps and receive times."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from scanwright.design.arrays import Floats, Ints, Times
from scanwright.design.findings import Finding
from scanwright.firmware_io.lidar.tick_line import half_hull, middle_slope
from scanwright.firmware_io.recording.bag_clocks import Stamps
from scanwright.firmware_io.recording.import_checks.headers import AT_M

_JITTER_S = 1e-3  # above the error of NTP and PTP
_LATE_S = 0.01  # delay of scans relative to angles that shows another clock, or a driver that delays them
_BLOCKS = 12  # of a recording, whose shortest delays are compared
_LEAST = 5  # messages in a block
_OF_SPREAD = 0.9  # random difference of the shortest delays of 12 blocks of 7 messages, relative to their jitter
_TREND_SIGMAS = 3.5  # of the mean delays; the largest in 400 good recordings was 2.5
_ALIKE = 0.3  # smallest trend of the shortest delays, relative to that of the mean delays
_LEAST_MM = 5.0  # at AT_M, to warn


def clock_findings(
    scans: Stamps, angles: Stamps, arc_ns: Ints, speed_rad_s: float, *, same_clock: bool
) -> Iterator[Finding]:
    """Check the stamps of scans and angles, in the order of their receipt.

    `arc_ns`: from the first to the last beam of each scan, shape (n,); `speed_rad_s`: usual speed of the axis, 0 if it
    rests during each scan; `same_clock`: scans and angles share a clock, such as that of one message.
    """
    for name, stamps in (("scans", scans), ("angles", angles)):
        yield from _steps_back(name, stamps, speed_rad_s)
    if not (scans.complete() and angles.complete()):
        return
    arc_s = float(np.median(arc_ns)) / 1e9
    least_s, angle_least_s = (float(np.quantile(_delay_s(stamps), 0.05)) for stamps in (scans, angles))
    if not same_clock and max(least_s - arc_s, angle_least_s) < -_JITTER_S:  # both are ahead of the receiver
        ahead_s = max(least_s - arc_s, angle_least_s)
        near = abs(least_s - arc_s - angle_least_s) < _LATE_S  # messages are delivered with such differences
        least_s, angle_least_s = (arc_s, 0.0) if near else (least_s - ahead_s, angle_least_s - ahead_s)
    if least_s < -_JITTER_S:
        yield _warning("scan_stamps_late", "scans", -least_s, speed_rad_s, f"stamps lie {-least_s:.4g} s after receipt",
                       'the clock of the lidar is ahead: correct it, or stamp = "receipt"')  # fmt: skip
    elif least_s - arc_s < -_JITTER_S:
        early_s = arc_s - least_s
        yield _warning("scan_stamp_not_first_beam", "scans", arc_s, speed_rad_s,
                       f"received {early_s:.4g} s before their last beam would be measured: stamps are not those of "
                       "the first beam", 'stamp = "last" if they are those of the last beam')  # fmt: skip
    if same_clock:
        return
    if angle_least_s < -_JITTER_S:
        yield _warning("angle_stamps_late", "angles", -angle_least_s, speed_rad_s,
                       f"stamps lie {-angle_least_s:.4g} s after receipt",
                       'the clock of the joint is ahead: correct it, or stamp = "receipt"')  # fmt: skip
    apart_s = least_s - arc_s - angle_least_s
    if abs(apart_s) > _LATE_S and least_s >= arc_s - _JITTER_S and angle_least_s >= -_JITTER_S:
        late, early = ("scans", "angles") if apart_s > 0 else ("angles", "scans")
        yield _warning("clocks_apart", late, abs(apart_s), speed_rad_s,
                       f"arrive {abs(apart_s):.4g} s later after their stamps than {early}: their clocks differ, or "
                       f"{late} are delivered late", f"scan_offset_s = {apart_s:.4g} if the clocks differ")  # fmt: skip
    elif speed_rad_s:
        cost = f"up to {1000 * AT_M * speed_rad_s * _LATE_S:,.0f} mm at {AT_M:g} m at this speed"
        text = f"clocks of scans and angles that differ by less than {1e3 * _LATE_S:g} ms cannot be seen here: {cost}"
        hint = "calibrate estimates the delay of the angles from the scene"
        yield Finding("clock_offset_unknown", "note", "clocks", text, _LATE_S, unit="s", hint=hint)
    yield from _drift(scans, angles, speed_rad_s)


def _drift(scans: Stamps, angles: Stamps, speed_rad_s: float) -> Iterator[Finding]:
    """Compare the shortest delays in blocks of time, which a drifting or stepping clock changes."""
    edges = np.linspace(float(scans.receive_ns.min()), float(scans.receive_ns.max()), _BLOCKS + 1)
    least, spread = [], [2 * _JITTER_S]
    for stamps in (scans, angles):
        block = np.clip(np.searchsorted(edges, stamps.receive_ns, side="right") - 1, 0, _BLOCKS - 1)
        delay_s = _delay_s(stamps)
        inside = (stamps.receive_ns >= edges[0]) & (stamps.receive_ns <= edges[-1])
        rows = [delay_s[inside & (block == k)] for k in range(_BLOCKS)]
        least.append(np.array([np.quantile(row, 0.1) if row.size >= _LEAST else math.nan for row in rows]))
        within = [float(np.ptp(np.quantile(row, [0.1, 0.9]))) for row in rows if row.size >= _LEAST]
        spread.append(_OF_SPREAD * float(np.median(within)) if within else 0.0)
    apart_s = (least[0] - least[1])[np.isfinite(least[0] - least[1])]
    if apart_s.size < 3:
        return
    # a single block may be a stall; a changed clock shows in two
    low, high = np.sort(apart_s)[[1, -2]] if apart_s.size > 4 else np.sort(apart_s)[[0, -1]]
    change_s = float(high - low)
    if change_s <= max(spread):
        change_s = _trend_s(scans, angles)
    cost_mm = 1000 * AT_M * speed_rad_s * change_s
    if cost_mm > _LEAST_MM:
        yield _warning("clocks_drift", "scans", change_s, speed_rad_s,
                       f"delay against the angles changes by {change_s:.4g} s during the recording: a clock drifts or "
                       "was set", 'stamp = "receipt", if messages arrive promptly')  # fmt: skip


def _trend_s(scans: Stamps, angles: Stamps) -> float:
    """Return the drift between the delays of scans and angles; 0 if mean and shortest delays disagree."""
    begin_ns, end_ns = int(scans.receive_ns.min()), int(scans.receive_ns.max())
    means, sigmas, least = [], [], []
    for stamps in (scans, angles):
        inside = (stamps.receive_ns >= begin_ns) & (stamps.receive_ns <= end_ns)
        share, delay_s = (stamps.receive_ns[inside] - begin_ns) / (end_ns - begin_ns), _delay_s(stamps)[inside]
        slope, start = np.polyfit(share, delay_s, 1)
        means.append(slope)
        sigmas.append(np.std(delay_s - start - slope * share) * math.sqrt(12 / share.size))
        order = np.argsort(share, kind="stable")
        least.append(middle_slope(half_hull(list(zip(share[order].tolist(), delay_s[order].tolist(), strict=True)), 1)))
    change_s = float(means[0] - means[1])
    chance_s = max(_TREND_SIGMAS * math.hypot(*sigmas), _JITTER_S)
    alike = (least[0] - least[1]) * math.copysign(1, change_s) > _ALIKE * abs(change_s)
    return abs(change_s) if abs(change_s) > chance_s and alike else 0.0


def _steps_back(name: str, stamps: Stamps, speed_rad_s: float) -> Iterator[Finding]:
    if not stamps.complete() or stamps.stamp_ns.size < 2:
        return
    step_s = np.diff(stamps.stamp_ns) / 1e9
    back = step_s < -_JITTER_S
    if back.any():
        worst_s = float(-step_s.min())
        yield _warning("stamps_go_back", name, worst_s, speed_rad_s,
                       f"stamps go back {np.sum(back)} times, by up to {worst_s:.4g} s",
                       'stamp = "receipt", if messages arrive promptly')  # fmt: skip
    again = int(np.sum(step_s == 0))
    if name == "scans" and again:
        text = f"{again} scans are not later than the one before them: their beams get wrong angles"
        hint = 'stamp = "receipt", or drop the copies if the driver repeats scans'
        yield Finding("stamps_repeat", "warning", name, text, again, hint=hint)


def _warning(code: str, subject: str, seconds: float, speed_rad_s: float, text: str, hint: str) -> Finding:
    cost_mm = 1000 * AT_M * speed_rad_s * seconds
    cost = f", {cost_mm:,.0f} mm at {AT_M:g} m at this speed" if cost_mm else ""
    return Finding(code, "warning", subject, f"{subject}: {text}{cost}", seconds, unit="s", hint=hint)


def _delay_s(stamps: Stamps) -> Floats:
    delay: Times = stamps.receive_ns - stamps.stamp_ns
    return delay / 1e9

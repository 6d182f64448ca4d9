"""Checks of the headers of scans: bearings, times between beams and ranges."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from scanwright.design.arrays import Floats, Ints, Times
from scanwright.design.findings import Finding
from scanwright.firmware_io.recording.import_checks.corrections import Corrections
from scanwright.firmware_io.samples import Scan

AT_M = 5.0  # range at which a finding states its position error
_LEAST_MM = 2.0  # at that range, to warn; the best lidars have 10 mm of noise
_WRONG_MM = 5.0  # at that range, of the last beam
_TIME_ERROR = 0.015  # of time_increment; real bags are within 0.01 (Hokuyo, RPLIDAR, SICK)
_TURN_ERROR = 0.03  # largest deviation from an integer of the turns between two scans, if a driver drops some
_SAME_RANGE = 0.01  # fraction of the beams with the longest range, above that of any scene
_FEWEST = 20  # beams


@dataclass(frozen=True, slots=True, eq=False)
class Headers:
    """Headers of the usable scans, shape (n,) each."""

    stamp_ns: Times
    beams: Ints  # number of ranges
    step_rad: Floats  # angle_increment
    span_rad: Floats  # angle_max - angle_min
    time_increment_s: Floats
    scan_time_s: Floats
    range_max_m: Floats
    longest: Counter[float]  # longest range -> number of beams with it, over all scans
    unequal_intensities: int  # number of scans with another number of intensities than ranges

    @classmethod
    def of(cls, rows: Iterable[tuple[float, ...]]) -> Headers:
        """Combine rows of `header_of`."""
        stamps, beams, steps, spans, increments, scan_times, limits, unequal, longest_m, count = map(
            np.array, zip(*rows, strict=True)
        )
        longest: Counter[float] = Counter()
        for far_m, number in zip(longest_m.tolist(), count.tolist(), strict=True):
            longest[far_m] += number
        return cls(stamps, beams, steps, spans, increments, scan_times, limits, +longest, int(np.sum(unequal)))

    def corrected(self, time_increment_s: float | None, corrections: Corrections) -> Headers:
        """Return the headers after corrections."""
        changed = self
        if time_increment_s is not None:
            changed = replace(changed, time_increment_s=np.full(self.beams.size, time_increment_s))
        if corrections.bearings == "limits":
            changed = replace(changed, step_rad=self.span_rad / np.maximum(self.beams - 1, 1))
        if corrections.no_return_from_m is not None:
            changed = replace(changed, longest=Counter[float]())
        return changed

    @property
    def bearings_disagree(self) -> Bool[ndarray, " n"]:
        """Which scans span another angle than angle_max - angle_min, shape (n,).

        That is n - 1 steps of n beams, or n in the headers of some drivers.
        """
        off_rad = [np.abs(self.span_rad - self.step_rad * (self.beams - k)) for k in (0, 1)]
        return (self.beams > 1) & (1000 * AT_M * np.minimum(*off_rad) > _WRONG_MM)

    def judged(self) -> Headers:
        """Return the headers for the checks of times; if steps and limits disagree, times between beams choose one."""
        if not self.bearings_disagree.any():
            return self
        by_limits = self.corrected(None, Corrections(bearings="limits"))
        off = [abs(each.time_increment_ratio - 1) for each in (self, by_limits)]
        return by_limits if off[1] < off[0] else self

    @property
    def time_increment_ratio(self) -> float:
        """Stated time between two beams relative to that of a uniform mirror turn; NaN if either is unknown."""
        even_s, stated_s = self.time_increment_from_turn_s, float(np.median(self.time_increment_s))
        return stated_s / even_s if even_s and stated_s else math.nan

    @property
    def mirror_turn_s(self) -> float:
        """Duration of a mirror turn: scan_time, or the median time between scans if it is no multiple (0: unknown)."""
        if self.stamp_ns.size < 2:
            return 0.0
        usual_s = float(np.median(np.diff(np.sort(self.stamp_ns)))) / 1e9
        scan_s = float(np.median(self.scan_time_s))
        turns = usual_s / scan_s if scan_s > 0 else 0.0
        return scan_s if turns > 0.5 and abs(turns - round(turns)) < _TURN_ERROR * turns else usual_s

    @property
    def time_increment_from_turn_s(self) -> float:
        """Time between two beams of a uniform mirror turn."""
        return float(np.median(np.abs(self.step_rad))) / (2 * math.pi) * self.mirror_turn_s

    @property
    def arc_ns(self) -> Times:
        """Time from the first to the last beam of each scan, shape (n,); by the mirror turn if that is known."""
        even_s = self.time_increment_from_turn_s
        increment_s = np.full(self.beams.size, even_s) if even_s else self.time_increment_s
        return np.rint(1e9 * increment_s * (self.beams - 1)).astype(np.int64)


def header_of(scan: Scan, span_rad: float, intensities: int) -> tuple[float, ...]:
    """Return the row of a scan for `Headers.of`; `span_rad`: angle_max - angle_min, `intensities`: their number."""
    longest_m = scan.range_m[np.isfinite(scan.range_m)].max(initial=0)
    return (
        scan.stamp_ns,
        scan.range_m.size,
        scan.angle_increment_rad,
        span_rad,
        scan.time_increment_s,
        scan.scan_time_s,
        scan.range_max_m,
        intensities not in (0, scan.range_m.size),
        float(longest_m),
        int(np.sum(scan.range_m == longest_m)) if longest_m > 0 else 0,
    )


def header_findings(headers: Headers, speed_rad_s: float) -> Iterator[Finding]:
    """Check the headers of the scans; `speed_rad_s`: usual speed of the axis, 0 if it rests during each scan."""
    yield from _bearings(headers)
    yield from _time_increment(headers.judged(), speed_rad_s)
    yield from _longest_range(headers)
    if count := headers.unequal_intensities:
        text = f"{count} scans have another number of intensities than ranges: dropped"
        yield Finding("intensities_unequal", "note", "intensities", text, count)


def _bearings(headers: Headers) -> Iterator[Finding]:
    step, span, beams, wrong = headers.step_rad, headers.span_rad, headers.beams, headers.bearings_disagree
    if not wrong.any():
        return
    k = int(np.flatnonzero(wrong)[0])
    cost_mm = 1000 * AT_M * float(np.max(np.abs(span[wrong] - step[wrong] * (beams[wrong] - 1))))
    text = (
        f"{np.sum(wrong)} scans: {beams[k]} beams at angle_increment {math.degrees(step[k]):.4g} deg span "
        f"{math.degrees(step[k] * (beams[k] - 1)):.4g} deg, angle_max - angle_min is {math.degrees(span[k]):.4g} deg: "
        f"one of them is wrong, by up to {_mm(cost_mm)} at {AT_M:g} m"
    )
    hint = 'bearings = "limits" spreads the beams from angle_min to angle_max'
    yield Finding("bearings_disagree", "warning", "angle_increment", text, cost_mm, unit="mm", hint=hint)


def _time_increment(headers: Headers, speed_rad_s: float) -> Iterator[Finding]:
    even_s, stated_s = headers.time_increment_from_turn_s, headers.time_increment_s
    arc = np.maximum(headers.beams - 1, 0)
    cost_mm = 1000 * AT_M * speed_rad_s * float(np.median(np.abs(stated_s - even_s) * arc))
    hint = f'time_increment = "auto" uses {even_s:.4g} s'
    if not stated_s.any():
        cost = f", off by up to {_mm(cost_mm)} at {AT_M:g} m at this speed" if cost_mm >= _LEAST_MM else ""
        text = f"the time increment is 0: every beam takes the time of its scan's stamp, not its own{cost}"
        yield Finding("time_increment_zero", "warning", "time_increment", text, cost_mm, unit="mm", hint=hint)
        return
    if not even_s:
        return
    ratio = headers.time_increment_ratio
    if abs(ratio - 1) > _TIME_ERROR and cost_mm >= _WRONG_MM:
        text = (
            f"the time increment is {ratio:.3g} times the step's share of a turn of {headers.mirror_turn_s:.4g} s: "
            f"beams are up to {_mm(cost_mm)} off at {AT_M:g} m at this speed"
        )
        yield Finding("time_increment_off", "warning", "time_increment", text, ratio, 1.0, "times", hint)
    wander = np.abs(stated_s / np.median(stated_s) - 1) > _TIME_ERROR if np.median(stated_s) else np.zeros(0, bool)
    if wander.any():
        worst_mm = 1000 * AT_M * speed_rad_s * float(np.max(np.abs(stated_s - np.median(stated_s)) * arc))
        if worst_mm >= _LEAST_MM:
            count = float(np.sum(wander))
            cost = f"beams are up to {_mm(worst_mm)} off at {AT_M:g} m at this speed"
            text = f"{count:.0f} scans have another time increment than most: {cost}"
            yield Finding("time_increment_changes", "warning", "time_increment", text, count, hint=hint)


def _longest_range(headers: Headers) -> Iterator[Finding]:
    if not headers.longest:
        return
    longest_m = max(headers.longest)
    count = headers.longest[longest_m]
    if count >= max(_FEWEST, _SAME_RANGE * headers.beams.sum()):
        limit = float(np.max(headers.range_max_m))
        what = "range_max" if longest_m >= np.float32(limit) else "one and the same range, the longest"
        text = f"{count:,} beams have {what}, {longest_m:.6g} m: probably no returns, which become points there"
        hint = f"no_return_from_m = {longest_m:.6g} drops them"
        yield Finding("longest_range_repeats", "warning", "ranges", text, longest_m, unit="m", hint=hint)


def _mm(value: float) -> str:
    return f"{value:,.0f} mm"

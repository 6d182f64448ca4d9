"""Checks of the angles of the axis: outliers, jumps and repeated stamps."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from scanwright.design.arrays import Floats, Ints, Times
from scanwright.design.findings import Finding, Severity
from scanwright.firmware_io.recording.import_checks.headers import AT_M
from scanwright.firmware_io.samples import JointLog

_REACH = 4  # neighbours on each side
_FAR_SHARE = 0.85  # of the neighbours; at a step of an axis that stops, half of them are far
_LEAST_RAD = math.radians(0.5)  # above the steps of encoders and rounded commands
_STEPS = 3.0  # median steps; a turning point is up to 1.5 off its neighbours
_SIGMAS = 8.0  # of the differences to the neighbours, above noise
_USUAL, _USUAL_SHARE = 8.0, 0.85  # times this quantile: integer degrees at uneven times are off their lines
_FARTHEST_STEPS = 3.0  # largest extrapolation of a line through two angles, in their distance
_MOVING_RAD_S = math.radians(1.0)  # slower than any sweep
_RESTS, _CAUGHT_UP = 5, 1.8  # steps of 0, and times the median speed after them, above the start of a servo
_FASTEST = 4.0  # times the median speed, above that of a servo in one sample


def usual_speed_rad_s(log: JointLog) -> float:
    """Return the usual speed of the axis while it moves; 0 if it never does."""
    seconds = np.diff(log.time_ns) / 1e9
    speed = np.abs(np.diff(log.position_rad)) / seconds
    moving = speed > _MOVING_RAD_S
    return float(np.median(speed[moving])) if moving.any() else 0.0


def outliers(time_ns: Times, position_rad: Floats) -> tuple[Bool[ndarray, " n"], Floats]:
    """Return which positions are far off their neighbours, and their deviation [rad], shape (n,) each.

    A good position is near the median of its neighbours, or on the line through the two before or after it (turning
    points).
    """
    count = position_rad.size
    wrong, off = np.zeros(count, bool), np.zeros(count)
    if count <= 2 * _REACH:
        return wrong, off
    inner = np.arange(_REACH, count - _REACH)
    near = [k for k in range(-_REACH, _REACH + 1) if k]
    apart = np.stack([_wrapped(position_rad[inner + k] - position_rad[inner]) for k in near])
    # Differences of about half a turn have both signs and cancel in a median.
    half_turn = np.abs(apart).min(axis=0) > np.pi / 2
    off[inner] = np.where(half_turn, np.median(np.abs(apart), axis=0), np.abs(np.median(apart, axis=0)))
    usual = float(np.median(np.abs(_wrapped(np.diff(position_rad)))))
    limit = max(_LEAST_RAD, _STEPS * usual, _SIGMAS * 1.4826 * float(np.median(off[inner])))
    wrong[inner] = (off[inner] > limit) & (np.mean(np.abs(apart) > limit, axis=0) >= _FAR_SHARE)
    rest = np.flatnonzero(~wrong)
    lone_rad = _off_both_lines(time_ns[rest], position_rad[rest])
    lone = lone_rad > max(_LEAST_RAD, _USUAL * float(np.quantile(lone_rad, _USUAL_SHARE)) if rest.size else 0)
    wrong[rest[lone]], off[rest[lone]] = True, lone_rad[lone]
    return wrong, off


def _off_both_lines(time_ns: Times, position_rad: Floats) -> Floats:
    """Return the distance to the nearer of the lines through two positions before and two after, shape (n,)."""
    off = np.zeros(time_ns.size)
    if off.size < 5:
        return off
    seconds = (time_ns - time_ns[0]) / 1e9
    here = np.arange(2, time_ns.size - 2)
    sides = []
    for side in (-1, 1):
        near, far = here + side, here + 2 * side
        apart_s = seconds[near] - seconds[far]
        steps = (seconds[here] - seconds[near]) / np.where(apart_s == 0, np.inf, apart_s)
        steps = np.where(steps <= _FARTHEST_STEPS, steps, 0)  # two angles at almost the same time give no rate
        line = position_rad[near] + _wrapped(position_rad[near] - position_rad[far]) * steps
        sides.append(np.abs(_wrapped(position_rad[here] - line)))
    apart_s = np.diff(seconds)
    gap_s = np.max([apart_s[k : k + here.size] for k in range(4)], axis=0)  # after a gap the position is unknown
    off[here] = np.where(gap_s > _FARTHEST_STEPS * np.median(apart_s), 0, np.minimum(*sides))
    return off


def angle_findings(time_ns: Times, position_rad: Floats, *, dropped: bool, timed: bool) -> Iterator[Finding]:
    """Check the angles, shape (n,), in the order of their times.

    `dropped`: outliers are dropped; `timed`: the times are exact enough to judge speeds by.
    """
    wrong, off = outliers(time_ns, position_rad)
    if wrong.any():
        cost_mm = 1000 * AT_M * float(np.sin(min(off[wrong].max(), math.pi / 2)))
        share = np.mean(wrong)
        far_deg = math.degrees(off[wrong].max())
        text = f"{np.sum(wrong):,} angles ({share:.2%}) lie up to {far_deg:.3g} deg off both neighbours"
        cost = ": dropped" if dropped else f", {cost_mm:,.0f} mm at {AT_M:g} m"
        hint = "" if dropped else "drop_outliers = true drops them"
        severity: Severity = "note" if dropped else "warning"
        yield Finding("angle_outliers", severity, "angle", text + cost, float(share), hint=hint)
    if timed:
        yield from _jumps(time_ns, position_rad, wrong)
    again = np.diff(time_ns) == 0
    apart = np.abs(_wrapped(np.diff(position_rad)))[again]
    if apart.size and apart.max() > _LEAST_RAD / 10:
        apart_deg = math.degrees(apart.max())
        text = f"{apart.size:,} angles have the time of another one, and differ from it by up to {apart_deg:.3g} deg"
        hint = "check for two publishers, or a clock of low resolution"
        yield Finding("angle_stamps_repeat", "warning", "angle", text, float(apart.size), hint=hint)


def _jumps(time_ns: Times, position_rad: Floats, wrong: Bool[ndarray, " n"]) -> Iterator[Finding]:
    """Report steps that are faster than the axis: the angle rested or was lost before."""
    keep = np.flatnonzero(~wrong)
    step_rad, seconds = np.abs(_wrapped(np.diff(position_rad[keep]))), np.diff(time_ns[keep]) / 1e9
    timed = seconds > 0
    step_rad, seconds = step_rad[timed], seconds[timed]
    speed = step_rad / seconds
    moving = speed > _MOVING_RAD_S
    if not moving.any():
        return
    far = step_rad > max(_LEAST_RAD, _FASTEST * float(np.median(step_rad[moving])))
    jump = far & (speed > _FASTEST * np.median(speed[moving]))
    if np.mean(moving) > 0.5:  # of a turning axis: repeated angles, and then a jump to the true one
        caught_up = (step_rad > max(_LEAST_RAD, _CAUGHT_UP * float(np.median(step_rad[moving])))) & (
            speed > _CAUGHT_UP * np.median(speed[moving])
        )
        jump |= caught_up & (_rests_before(step_rad) >= _RESTS)
    if jump.any():
        worst_rad = float(step_rad[jump].max())
        text = (
            f"{np.sum(jump):,} steps between angles are faster than {_FASTEST:g} times the usual speed, up to "
            f"{math.degrees(worst_rad):.3g} deg: the angle rested, or the axis slipped; "
            f"{1000 * AT_M * math.sin(min(worst_rad, math.pi / 2)):,.0f} mm at {AT_M:g} m"
        )
        hint = "check the source of the angle around these times"
        yield Finding("angle_jumps", "warning", "angle", text, float(np.sum(jump)), hint=hint)


def _rests_before(step_rad: Floats) -> Ints:
    """Return the number of steps of exactly 0 directly before each step, shape (n,)."""
    number = np.arange(step_rad.size)
    last_moved = np.maximum.accumulate(np.where(step_rad > 0, number, -1))
    return number - 1 - np.concatenate([[-1], last_moved[:-1]])


def _wrapped(angle_rad: Floats) -> Floats:
    return (angle_rad + math.pi) % (2 * math.pi) - math.pi

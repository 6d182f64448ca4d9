"""Servo angle between the steps of its encoder: a smoothing spline with a known error.

An encoder of 4096 steps per turn has a resolution of 0.088 deg, 15 mm at 10 m; linear interpolation keeps that noise
and adds corners. A servo moves more smoothly: a cubic spline with one knot for several samples, fitted by least
squares, averages the steps. Generalised cross-validation chooses the number of samples per knot: too few keep the
noise, too many miss the motion.

The fit does not show an error of all samples (offset, eccentric magnet; calibration does), or motion between two
samples that does not affect them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64
from numpy import ndarray
from scipy.linalg import solveh_banded

from scanwright.design.arrays import Floats, Ints, Times
from scanwright.firmware_io.recording.import_checks.angles import outliers
from scanwright.firmware_io.samples import AxisCurve, JointLog, straight

_LEAST = 32  # samples, to average
_FINEST = 4  # samples per knot
_MOST_REJECTED = 0.1  # fraction of the samples; beyond it wrong and right ones are indistinguishable
_PASSES = 4  # fits without outliers; each may show smaller ones
_NEIGHBOURS = 3  # on each side; more consecutive outliers are a slip
_OFF_SIGMAS = 6.0  # robust standard deviations off the curve, above noise
_OFF_STEPS = 1.5  # encoder steps, above rounding and the error of the curve
_LISTED = 5  # times of rejected samples in a message
_SWING = 6.0  # times the rms of the residuals; larger ones are jumps (a stop, a slip)
_MISSED = 2 / np.sqrt(12)  # encoder steps; twice the rms of rounding is motion that the curve misses
_REST_S = 0.1  # a slower staircase may be an axis that stops for its scans
_STEPS_PER_KNOT = 8.0  # smallest number of encoder steps between knots, or the fit follows the staircase


@dataclass(frozen=True, slots=True, eq=False)
class SmoothAxis:
    """A smoothed joint log."""

    curve: AxisCurve
    knot_s: float  # median time between two knots
    per_knot: float  # samples per knot
    step_rad: float  # of the encoder; 0 if the positions have none
    residual_rad: float  # rms of the samples
    error_rad: float  # rms error of the curve, from its residuals and those of a curve with half the knots
    rejected_ns: Times  # times of the outliers


def axis_curve(log: JointLog, *, at_rest: bool) -> tuple[AxisCurve, str]:
    """Return the angle for assembly, smoothed if that is better than linear interpolation, and a line about it.

    `at_rest`: the motor rested during each scan, so the log is exact.
    """
    if at_rest:
        return straight(log), "axis angle: held during each scan"
    fitted = smooth(log)
    if isinstance(fitted, str):
        return straight(log), f"axis angle: straight between samples ({fitted})"
    off_deg, error_deg = np.degrees([fitted.residual_rad, fitted.error_rad])
    return fitted.curve, (
        f"axis angle: smoothed, a knot every {fitted.knot_s:.3g} s; samples lie {off_deg:.2g} deg rms off the curve, "
        f"the curve about {error_deg:.1g} deg rms off the truth{_rejected(fitted.rejected_ns, log)}"
    )


def _rejected(rejected_ns: Times, log: JointLog) -> str:
    """Format the times of rejected samples since the first one."""
    if not rejected_ns.size:
        return ""
    seconds = [f"{(time_ns - log.time_ns[0]) / 1e9:.2f}" for time_ns in rejected_ns[:_LISTED].tolist()]
    more = " ..." if rejected_ns.size > _LISTED else ""
    return f"; rejected {rejected_ns.size} of {log.time_ns.size} angles, at {', '.join(seconds)}{more} s"


def smooth(log: JointLog, *, longest_knot_s: float = math.inf, per_knot: float | None = None) -> SmoothAxis | str:
    """Fit a spline to the log without isolated outliers, or return why linear interpolation is better.

    `longest_knot_s`: largest time between two knots; `per_knot`: samples per knot, None for cross-validation.
    """
    whole, residual = _smooth(log, longest_knot_s, per_knot)
    if not residual.size:
        return whole
    wrong = _isolated(residual, _encoder_step(log.position_rad))
    if isinstance(whole, str) and (far := outliers(log.time_ns, log.position_rad)[0]).any():
        wrong = far  # large ones may have distorted the entire curve, or added a turn
    fitted: SmoothAxis | str = whole
    for _ in range(_PASSES):
        if not 0 < np.mean(wrong) <= _MOST_REJECTED:
            break
        position_rad = np.unwrap(log.position_rad[~wrong])
        fitted, residual = _smooth(JointLog(log.time_ns[~wrong], position_rad), longest_knot_s, per_knot)
        more = _isolated(residual, _encoder_step(position_rad))
        if not more.any():
            break
        wrong[np.flatnonzero(~wrong)[more]] = True
    if isinstance(fitted, str):
        return whole
    off = np.abs(np.angle(np.exp(1j * (log.position_rad - fitted.curve.angle_at(log.time_ns)))))
    wrong &= ~(off <= max(_OFF_SIGMAS * fitted.residual_rad, _OFF_STEPS * fitted.step_rad))  # not good ones
    in_a_row = np.lib.stride_tricks.sliding_window_view(wrong, _NEIGHBOURS + 1).all(axis=1)
    # so many consecutive outliers are a slip
    return whole if in_a_row.any() else replace(fitted, rejected_ns=log.time_ns[wrong])


def _isolated(residual: Float64[ndarray, " n"], step_rad: float) -> Bool[ndarray, " n"]:
    """Return which samples are off a curve unlike most of their neighbours; none at the ends."""
    wrong = np.zeros(residual.size, bool)
    if residual.size > 2 * _NEIGHBOURS:
        near = np.delete(np.lib.stride_tricks.sliding_window_view(residual, 2 * _NEIGHBOURS + 1), _NEIGHBOURS, axis=1)
        apart = np.abs(residual[_NEIGHBOURS:-_NEIGHBOURS] - np.median(near, axis=1))
        limit = max(_OFF_SIGMAS * 1.4826 * float(np.median(apart)), _OFF_STEPS * step_rad)
        wrong[_NEIGHBOURS:-_NEIGHBOURS] = apart > limit
    return wrong


def _smooth(log: JointLog, longest_knot_s: float, per_knot: float | None) -> tuple[SmoothAxis | str, Floats]:
    """Return the fit to all samples or the reason for none, and its residuals (empty without a fit)."""
    count, nothing = log.time_ns.size, np.empty(0)
    if count < _LEAST:
        return f"{count} samples are too few to smooth", nothing
    seconds = (log.time_ns - log.time_ns[0]) / 1e9
    position = log.position_rad
    step_rad = _encoder_step(position)
    per_step = _samples_per_step(position, step_rad)
    usual_s = float(np.median(np.diff(seconds)))
    if per_step * usual_s > _REST_S:
        return f"the angle rests {per_step * usual_s:.2g} s on each value: does the axis stop?", nothing
    least = float(max(_FINEST, per_step * _STEPS_PER_KNOT))
    most = longest_knot_s / usual_s
    if least > most:
        return f"{least:.0f} samples to a knot would be more than {longest_knot_s:.3g} s apart", nothing
    best = _best(seconds, position, least, most) if per_knot is None else _fit(seconds, position, per_knot)
    residual = best.residual
    if best.score >= _straight_score(seconds, position, step_rad):
        return "a smooth curve predicts them no better", residual
    rms = float(np.sqrt(np.mean(residual**2)))
    if step_rad and rms > _MISSED * step_rad:
        return f"they lie {np.degrees(rms):.2g} deg rms off a smooth curve, more than their steps explain", residual
    if np.abs(residual).max() > _SWING * rms + step_rad:
        return f"they jump: one lies {np.degrees(np.abs(residual).max()):.2g} deg off a smooth curve", residual
    knots = best.knots[3:-3]
    curve = AxisCurve(
        knot_ns=log.time_ns[0] + np.rint(knots * 1e9).astype(np.int64),
        coefficient=np.ascontiguousarray(_polynomials(best.knots, best.weight)),
    )
    smoothed = SmoothAxis(
        curve=curve,
        knot_s=float(np.median(np.diff(knots))),
        per_knot=best.per_knot,
        step_rad=step_rad,
        residual_rad=rms,
        error_rad=_error(seconds, position, best, rms, per_step),
        rejected_ns=np.empty(0, np.int64),
    )
    return smoothed, residual


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """A least-squares spline."""

    knots: Floats
    weight: Floats
    residual: Floats
    per_knot: float
    score: float  # expected mean squared error of a new sample (cross-validation)


def _best(seconds: Float64[ndarray, " n"], position: Float64[ndarray, " n"], least: float, most: float) -> _Fit:
    """Return the fit of the lowest score with `least` to `most` samples per knot."""
    fits: list[_Fit] = []
    per_knot = least
    while per_knot <= most and (per_knot < seconds.size / 4 or not fits):
        fits.append(_fit(seconds, position, per_knot))
        if fits[-1].score > 2 * min(fit.score for fit in fits):
            break
        per_knot *= 2
    return min(fits, key=lambda fit: fit.score)


def _fit(seconds: Float64[ndarray, " n"], position: Float64[ndarray, " n"], per_knot: float) -> _Fit:
    count = seconds.size
    # knots at samples, uniform by number and not by time, so that none is in a gap
    inner = seconds[np.linspace(0, count - 1, max(round(count / per_knot), 1) + 1).round().astype(int)]
    knots = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])
    # normal equations of cubic B-splines: at each sample four consecutive ones are not 0, so the matrix is banded
    piece = np.searchsorted(inner[1:-1], seconds, "right") + 3
    value, first = _b_splines(seconds, knots, piece, 3), piece - 3
    unknowns = knots.size - 4
    band, right = np.zeros((4, unknowns)), np.zeros(unknowns)
    for k in range(4):
        right += np.bincount(first + k, value[k] * position, unknowns)
        for below in range(4 - k):
            band[below] += np.bincount(first + k, value[k] * value[k + below], unknowns)
    weight = solveh_banded(band, right, lower=True)
    residual = position - sum(value[k] * weight[first + k] for k in range(4))
    score = np.mean(residual**2) / (1 - unknowns / count) ** 2
    return _Fit(knots, weight, residual, per_knot, float(score))


def _b_splines(at: Floats, knots: Floats, piece: Ints, degree: int) -> list[Floats]:
    """Return the non-zero B-splines in the piece of each time, from number `piece - degree` (de Boor's recurrence)."""
    value = [np.ones_like(at)]
    for d in range(1, degree + 1):
        carry = np.zeros_like(at)
        for k in range(d):
            after, before = knots[piece + k + 1], knots[piece + k + 1 - d]
            part = value[k] / (after - before)
            value[k] = carry + (after - at) * part
            carry = (at - before) * part
        value.append(carry)
    return value


def _polynomials(knots: Floats, weight: Floats) -> Floats:
    """Return the polynomials of a cubic spline, shape (pieces, 4): powers 0 to 3 of the time since a knot.

    They follow from four values in each piece.
    """
    inner, first = knots[3:-3], np.arange(knots.size - 7)
    length, parts = np.diff(inner), np.linspace(0, 1, 4)
    values = []
    for part in parts:
        splines = _b_splines(inner[:-1] + part * length, knots, first + 3, 3)
        values.append(sum(splines[k] * weight[first + k] for k in range(4)))
    return (np.linalg.solve(np.vander(parts, increasing=True), values) / length ** np.arange(4)[:, None]).T


def _straight_score(seconds: Float64[ndarray, " n"], position: Float64[ndarray, " n"], step_rad: float) -> float:
    """Return the mean squared error of linear interpolation by leave-one-out cross-validation."""
    part = (seconds[1:-1] - seconds[:-2]) / (seconds[2:] - seconds[:-2])
    missed = float(np.mean((position[:-2] + part * (position[2:] - position[:-2]) - position[1:-1]) ** 2))
    # samples on one step of a slow axis predict each other, but not the axis
    return max(missed, 1.5 * step_rad**2 / 12)


def _error(
    seconds: Float64[ndarray, " n"], position: Float64[ndarray, " n"], best: _Fit, rms: float, correlated: float
) -> float:
    """Return the rms error of the curve by noise and missing knots.

    Noise keeps `coefficients / count` of its power, more if neighbouring samples share a step of the encoder. A curve
    with half the knots misses 16 times as much of the motion (rms), which shows in the difference beyond noise.
    """
    count = seconds.size
    noise = rms**2 * best.weight.size / count * max(correlated, 1.0)
    coarse = _fit(seconds, position, 2 * best.per_knot)
    differs = float(np.mean((coarse.residual - best.residual) ** 2))
    missed = max(differs - noise / 2, 0.0) / 15**2
    return float(np.sqrt(noise + missed))


def _encoder_step(position: Float64[ndarray, " n"]) -> float:
    """Return the step of which all positions modulo a turn are multiples, except for an offset; 0 without one."""
    apart = np.diff(np.sort(position % (2 * np.pi)))
    apart = apart[apart > 1e-9]
    if not apart.size:
        return 0.0
    steps = apart / apart.min()
    return float(apart.min()) if np.abs(steps - np.rint(steps)).max() < 0.02 else 0.0


def _samples_per_step(position: Float64[ndarray, " n"], step_rad: float) -> float:
    """Return the mean number of samples per step of the encoder."""
    if not step_rad:
        return 0.0
    return float((position.size - 1) * step_rad / np.abs(np.diff(position)).sum())

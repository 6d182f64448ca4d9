"""The servo angle between the steps of its encoder: a smoothing spline with a known error.

An encoder of 4096 steps a turn reads in steps of 0.088 deg, 15 mm at 10 m; a line drawn from sample to sample keeps
that noise and adds the corners. Servos are heavier than that: a cubic spline with one knot for several samples, fitted
to all of them by least squares, averages the steps away. How many samples a knot gets is chosen by generalised
cross-validation: too few keep the noise, too many miss the motion.

What the fit cannot know: an error that every sample shares (offset, eccentric magnet; calibration sees those), and
what the axis does between two samples without a trace in them.
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

_LEAST = 32  # samples; with fewer there is nothing to average
_FINEST = 4  # samples to a knot
_MOST_REJECTED = 0.1  # share of the samples; beyond it the right ones cannot be told apart
_PASSES = 4  # of fits without the samples that are off; each may show smaller ones
_BESIDE = 3  # neighbours on each side; as many wrong samples in a row can be told from a slip
_OFF_SIGMAS = 6.0  # robust standard deviations off the curve that is no noise
_OFF_STEPS = 1.5  # of the encoder: rounding and the curve's own error are less
_LISTED = 5  # times of rejected samples in a message
_SWING = 6.0  # residuals beyond this many times their rms are jumps (a stop, a slip), not noise
_MISSED = 2 / np.sqrt(12)  # of a step; twice what rounding to steps does is motion that the curve misses
_REST_S = 0.1  # a staircase slower than this may as well be an axis that stops for its scans
_STEPS_PER_KNOT = 8.0  # the axis must pass this many encoder steps between knots, or the fit follows the staircase


@dataclass(frozen=True, slots=True, eq=False)
class SmoothAxis:
    """A smoothed joint log.

    Attributes:
        error_rad: rms error of the curve, from its residuals and from what a curve with half the knots makes of them.
    """

    curve: AxisCurve  # the angle
    knot_s: float  # usual time from knot to knot
    per_knot: float  # samples to a knot
    step_rad: float  # step of the encoder; 0 where the positions have none
    residual_rad: float  # rms of samples against the curve
    error_rad: float
    rejected_ns: Times  # times of the samples that lie far off the others and were not used


def axis_curve(log: JointLog, *, at_rest: bool) -> tuple[AxisCurve, str]:
    """The angle to assemble with, and one line about it: smoothed where that is better than straight lines.

    `at_rest`: the motor stood still during each scan; the log is exact then.
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
    """Name the samples that were rejected, by their times after the first one."""
    if not rejected_ns.size:
        return ""
    seconds = [f"{(time_ns - log.time_ns[0]) / 1e9:.2f}" for time_ns in rejected_ns[:_LISTED].tolist()]
    more = " ..." if rejected_ns.size > _LISTED else ""
    return f"; rejected {rejected_ns.size} of {log.time_ns.size} angles, at {', '.join(seconds)}{more} s"


def smooth(log: JointLog, *, longest_knot_s: float = math.inf, per_knot: float | None = None) -> SmoothAxis | str:
    """Fit a spline to the log without the samples that lie off it alone, or say why straight lines are better.

    Args:
        log: at least 32 samples, or nothing can be averaged.
        longest_knot_s: no knots farther apart, whatever cross-validation says.
        per_knot: samples to a knot, where that has been chosen already; else cross-validation chooses.
    """
    whole, residual = _smooth(log, longest_knot_s, per_knot)
    if not residual.size:
        return whole
    wrong = _isolated(residual, _encoder_step(log.position_rad))
    if isinstance(whole, str) and (far := outliers(log.time_ns, log.position_rad)[0]).any():
        wrong = far  # large ones may have bent all of the curve, or cost a turn
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
    wrong &= ~(off <= max(_OFF_SIGMAS * fitted.residual_rad, _OFF_STEPS * fitted.step_rad))  # a good one among bad ones
    in_a_row = np.lib.stride_tricks.sliding_window_view(wrong, _BESIDE + 1).all(axis=1)
    # an axis that slips leaves that many beside each other
    return whole if in_a_row.any() else replace(fitted, rejected_ns=log.time_ns[wrong])


def _isolated(residual: Float64[ndarray, " n"], step_rad: float) -> Bool[ndarray, " n"]:
    """Return which samples lie off a curve while most of their neighbours do not; none at the ends."""
    wrong = np.zeros(residual.size, bool)
    if residual.size > 2 * _BESIDE:
        near = np.delete(np.lib.stride_tricks.sliding_window_view(residual, 2 * _BESIDE + 1), _BESIDE, axis=1)
        apart = np.abs(residual[_BESIDE:-_BESIDE] - np.median(near, axis=1))
        limit = max(_OFF_SIGMAS * 1.4826 * float(np.median(apart)), _OFF_STEPS * step_rad)
        wrong[_BESIDE:-_BESIDE] = apart > limit
    return wrong


def _smooth(log: JointLog, longest_knot_s: float, per_knot: float | None) -> tuple[SmoothAxis | str, Floats]:
    """The fit to all samples or the reason for none, and how far each sample lies off it (empty before a fit)."""
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
        coefficient=_polynomials(best.knots, best.weight),
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
    """A least-squares spline; `score` is the mean squared error it will make on a new sample (cross-validation)."""

    knots: Floats
    weight: Floats
    residual: Floats
    per_knot: float
    score: float


def _best(seconds: Float64[ndarray, " n"], position: Float64[ndarray, " n"], least: float, most: float) -> _Fit:
    """The fit of the lowest score with `least` to `most` samples to a knot."""
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
    # knots at samples, evenly by number and not by time: none is left without samples in a gap
    inner = seconds[np.linspace(0, count - 1, max(round(count / per_knot), 1) + 1).round().astype(int)]
    knots = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])
    # normal equations of cubic B-splines: at each sample four beside each other are not 0, so the matrix is a band
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
    """The B-splines that are not 0 in the piece of each time, number `piece - degree` first (de Boor's recurrence)."""
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
    """A cubic spline from knot to knot, shape (pieces, 4): powers 0 to 3 of the time into the piece."""
    first, columns = np.arange(knots.size - 7), []
    for power, degree in enumerate((3, 2, 1, 0)):
        begin = knots[first + degree]
        value = _b_splines(begin, knots, first + degree, degree)
        columns.append(sum(value[k] * weight[first + k] for k in range(degree + 1)) / math.factorial(power))
        if degree:  # on to the derivative, a spline of one degree less
            weight = degree * np.diff(weight) / (knots[degree + 1 : -1] - knots[1 : -degree - 1])
            knots = knots[1:-1]
    return np.stack(columns, axis=1)


def _straight_score(seconds: Float64[ndarray, " n"], position: Float64[ndarray, " n"], step_rad: float) -> float:
    """Mean squared error of straight lines on a new sample: each sample is left out in turn."""
    part = (seconds[1:-1] - seconds[:-2]) / (seconds[2:] - seconds[:-2])
    missed = float(np.mean((position[:-2] + part * (position[2:] - position[:-2]) - position[1:-1]) ** 2))
    # samples on one step of a slow axis predict each other, but not the axis
    return max(missed, 1.5 * step_rad**2 / 12)


def _error(
    seconds: Float64[ndarray, " n"], position: Float64[ndarray, " n"], best: _Fit, rms: float, correlated: float
) -> float:
    """What noise and what missing knots do to the curve, both as rms.

    Noise keeps `unknowns / count` of its power, more where neighbouring samples share a step of the encoder. A curve
    with half the knots misses 16 times as much of the motion (in rms); what it differs by beyond its noise tells.
    """
    count = seconds.size
    noise = rms**2 * best.weight.size / count * max(correlated, 1.0)
    coarse = _fit(seconds, position, 2 * best.per_knot)
    differs = float(np.mean((coarse.residual - best.residual) ** 2))
    missed = max(differs - noise / 2, 0.0) / 15**2
    return float(np.sqrt(noise + missed))


def _encoder_step(position: Float64[ndarray, " n"]) -> float:
    """The step of which all positions within a turn are multiples, up to a common offset; 0 where there is none."""
    apart = np.diff(np.sort(position % (2 * np.pi)))
    apart = apart[apart > 1e-9]
    if not apart.size:
        return 0.0
    steps = apart / apart.min()
    return float(apart.min()) if np.abs(steps - np.rint(steps)).max() < 0.02 else 0.0


def _samples_per_step(position: Float64[ndarray, " n"], step_rad: float) -> float:
    """How many samples the axis usually stays on one step of the encoder."""
    if not step_rad:
        return 0.0
    return float((position.size - 1) * step_rad / np.abs(np.diff(position)).sum())

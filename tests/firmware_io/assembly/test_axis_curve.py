"""The smoothed servo angle: nearer to the truth than straight lines, by as much as it says, and only where it can."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import make_lsq_spline

from scanwright.firmware_io.assembly.axis_curve import SmoothAxis, axis_curve, smooth
from scanwright.firmware_io.samples import JointLog, straight

START = 1_700_000_000_000_000_000
STEP = 2 * np.pi / 4096


def turning(speed_deg_s, duration_s=10.0, rate_hz=100.0, step_rad=STEP, jitter=0.3, seed=0):
    """A servo at one speed with the ripple of its gears, read by an encoder; and the truth."""
    rng = np.random.default_rng(seed)
    phase = rng.uniform(0, 6, 3)
    speed = np.radians(speed_deg_s)

    def truth(seconds):
        turned = speed * seconds
        return turned + 0.01 * np.sin(turned + phase[0]) + 0.003 * np.sin(3 * turned + phase[1])

    seconds = np.arange(round(duration_s * rate_hz)) / rate_hz
    seconds[1:] += rng.uniform(-jitter, jitter, seconds.size - 1) / rate_hz
    time_ns = np.rint(seconds * 1e9).astype(np.int64)
    position = truth(time_ns / 1e9)
    position = np.rint(position / step_rad) * step_rad if step_rad else position
    return JointLog(START + time_ns, position), truth


def off_rad(curve, log, truth):
    asked_ns = np.linspace(0, log.time_ns[-1] - log.time_ns[0], 20_000).astype(np.int64)
    return np.sqrt(np.mean((curve.angle_at(log.time_ns[0] + asked_ns) - truth(asked_ns / 1e9)) ** 2))


@settings(deadline=None, max_examples=15)
@given(
    speed=st.floats(10, 720),
    rate_hz=st.sampled_from([60.0, 100.0, 500.0]),
    way=st.sampled_from([1, -1]),
    seed=st.integers(0, 99),
)
def test_smoothing_is_nearer_than_straight_lines_and_says_by_how_much(speed, rate_hz, way, seed):
    log, truth = turning(way * speed, rate_hz=rate_hz, seed=seed)
    found = smooth(log)
    if isinstance(found, str):  # nothing is left to average
        assert abs(speed) / rate_hz > 2, found
        return
    error = off_rad(found.curve, log, truth)
    assert error < 1.05 * off_rad(straight(log), log, truth)  # a fast servo read rarely: hardly better, never worse
    assert error / 3 < found.error_rad < 8 * error  # on the safe side where steps last for many samples
    assert found.residual_rad == pytest.approx(STEP / np.sqrt(12), rel=0.25)


def test_the_curve_is_the_spline_of_least_squares():
    log, _ = turning(20)
    found = smooth(log)
    seconds, knots = (log.time_ns - log.time_ns[0]) / 1e9, (found.curve.knot_ns - log.time_ns[0]) / 1e9
    known = make_lsq_spline(seconds, log.position_rad, np.pad(knots, 3, "edge"))
    asked_ns = np.linspace(log.time_ns[0], log.time_ns[-1], 999).astype(np.int64)
    asked_s = (asked_ns - log.time_ns[0]) / 1e9
    np.testing.assert_allclose(found.curve.angle_at(asked_ns), known(asked_s), rtol=0, atol=1e-9)


def test_at_the_speed_of_a_careful_scan_the_error_falls_to_a_third():
    log, truth = turning(20, duration_s=36)
    found = smooth(log)
    assert off_rad(found.curve, log, truth) < off_rad(straight(log), log, truth) / 3
    assert found.step_rad == pytest.approx(STEP)


def test_a_log_without_steps_is_followed_closely():
    log, truth = turning(180, step_rad=0)
    assert off_rad(smooth(log).curve, log, truth) < 1e-6


@pytest.mark.parametrize("log", [turning(20)[0], JointLog(START + np.arange(2), np.array([1.0, 2.0]))])
def test_the_curve_covers_the_log_and_no_more(log):
    curve, _ = axis_curve(log, at_rest=False)
    ends = np.array([log.time_ns[0], log.time_ns[-1]])
    assert np.isfinite(curve.angle_at(ends)).all()
    assert np.isnan(curve.angle_at(ends + np.array([-1, 1]))).all()


def stop_and_go():
    seconds = np.arange(0, 20, 0.01)
    return JointLog(START + np.rint(seconds * 1e9).astype(np.int64), np.floor(seconds) * 0.1)


def slipped():
    log, _ = turning(20)
    position = log.position_rad.copy()
    position[500:] += 0.3
    return JointLog(log.time_ns, position)


def stamped_when_received():
    """Whole degrees at times that are late by chance: what is off by more than the steps is not understood."""
    seconds = np.arange(0, 50, 0.05)
    late = np.random.default_rng(0).uniform(0, 0.04, seconds.size)
    time_ns = START + np.rint((seconds + late) * 1e9).astype(np.int64)
    return JointLog(time_ns, np.radians(np.rint(80 * seconds + 3 * np.sin(seconds))))


@pytest.mark.parametrize(
    ("log", "at_rest", "says"),
    [
        (turning(20)[0], True, "held during each scan"),
        (turning(20, duration_s=0.3)[0], False, "30 samples are too few"),
        (slipped(), False, "straight between samples ("),
        (stamped_when_received(), False, "rms off a smooth curve, more than their steps explain"),
        (stop_and_go(), False, "rests 1.1 s on each value: does the axis stop"),
    ],
)
def test_where_smoothing_would_invent_it_goes_straight_and_says_why(log, at_rest, says):
    curve, said = axis_curve(log, at_rest=at_rest)
    assert says in said
    np.testing.assert_allclose(curve.angle_at(log.time_ns), log.position_rad, atol=1e-9)


@pytest.mark.parametrize("wrong", [[500], [500, 501, 700], range(20, 980, 25)], ids=["one", "three", "every 25th"])
def test_wrong_readings_are_rejected_and_named(wrong):
    log, truth = turning(20)
    position = log.position_rad.copy()
    position[list(wrong)] = 3.0 * np.random.default_rng(0).choice([-1, 1], len(wrong))
    spoilt = JointLog(log.time_ns, position)
    curve, said = axis_curve(spoilt, at_rest=False)
    assert off_rad(curve, log, truth) < 1.3 * off_rad(axis_curve(log, at_rest=False)[0], log, truth)
    named = (log.time_ns[wrong[0]] - log.time_ns[0]) / 1e9
    assert f"rejected {len(wrong)} of {log.time_ns.size} angles, at {named:.2f}" in said


@pytest.mark.parametrize("counts", [3, 7, 40, 800])
@pytest.mark.parametrize("share", [1, 10, 50])
def test_wrong_readings_of_any_size_cost_next_to_nothing(counts, share):
    """Seven steps off, one angle of 1000 made the whole log go straight between samples; three bent the curve."""
    log, truth = turning(20)
    rng = np.random.default_rng(share)
    wrong = rng.choice(np.arange(5, 995), share, replace=False)
    position = log.position_rad.copy()
    position[wrong] += counts * STEP * rng.choice([-1, 1], share)
    found = smooth(JointLog(log.time_ns, position))
    assert np.isin(log.time_ns[wrong], found.rejected_ns).mean() >= 0.9
    assert np.isin(found.rejected_ns, log.time_ns[wrong]).mean() > 0.98
    assert off_rad(found.curve, log, truth) < 1.3 * off_rad(smooth(log).curve, log, truth)


def slip(counts):
    log, _ = turning(20)
    position = log.position_rad.copy()
    position[500:] += counts * STEP
    return JointLog(log.time_ns, position)


@pytest.mark.parametrize("counts", [20, 40, 800])
def test_a_slip_is_no_wrong_reading(counts):
    assert isinstance(smooth(slip(counts)), str)


@pytest.mark.parametrize("speed", [10, 60, 360])
@pytest.mark.parametrize("rate_hz", [60.0, 500.0])
def test_no_good_reading_is_rejected(speed, rate_hz):
    found = smooth(turning(speed, rate_hz=rate_hz)[0])
    assert isinstance(found, str) or not found.rejected_ns.size


def test_a_gap_in_the_log_does_not_break_the_fit():
    log, truth = turning(20, duration_s=36)
    kept = (log.time_ns < START + 10 * 10**9) | (log.time_ns > START + 11 * 10**9)
    found = smooth(JointLog(log.time_ns[kept], log.position_rad[kept]))
    assert isinstance(found, SmoothAxis)
    assert off_rad(found.curve, log, truth) < 2e-3


@settings(deadline=None)
@given(
    times=st.lists(st.integers(0, 10**12), min_size=1, max_size=20, unique=True).map(sorted),
    asked=st.lists(st.integers(-(10**11), 2 * 10**12), min_size=1, max_size=20),
)
def test_straight_pieces_are_the_log(times, asked):
    log = JointLog(START + np.array(times), np.cos(np.arange(len(times)) * 9.0) * 7)
    for asked_ns in (START + np.array(asked), log.time_ns):
        np.testing.assert_allclose(straight(log).angle_at(asked_ns), log.angle_at(asked_ns), rtol=0, atol=1e-9)

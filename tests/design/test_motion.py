"""Motions: the trapezoid against numerical integration, a sweep's density against simulated scans."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from quick_tests import samples
from scipy.spatial import cKDTree

from scanwright.design.density.beams import beam_directions_rot, scan_at
from scanwright.design.density.spin import ball_search
from scanwright.design.density.sweep import SweepLines, mean_count_swept, phase_statistics_swept
from scanwright.design.evaluation.coverage import coverage
from scanwright.design.evaluation.gaps import empty_cap, gaps
from scanwright.design.frames import R_world_rot
from scanwright.design.motion import StopAndGo, Sweep
from scanwright.design.objective.ball_search import ball_score
from scanwright.design.objective.named_objectives import log_density
from scanwright.design.objective.problem import motion_lines, problem_of
from scanwright.design.objective.score import score
from scanwright.design.sphere.directions import spiral
from scanwright.design.task.task import load_task

FAN = np.radians(np.linspace(-119.5, 119.9, 171))
limit = st.floats(-180, 180)


@st.composite
def sweeps(draw):
    lower, upper = sorted((draw(limit), draw(limit)))
    assume(upper - lower >= 0.1)
    accel = draw(st.floats(5, 5000))
    least = 4 * np.sqrt((upper - lower) / accel)
    period = least * draw(st.floats(1.001, 20)) + 0.01
    assume(period < 600)
    return Sweep(limits_deg=(lower, upper), period_s=period, accel_deg_s2=accel)


@given(sweeps())
@settings(max_examples=60, deadline=None)
def test_a_trapezoid_is_its_accelerations_integrated_twice(sweep):
    """Accelerate, cruise, brake, and the same back: the speed is a sum of ramps, its integral the angle."""
    t = np.linspace(0, sweep.period_s, 20_001)
    half, ramp, a = sweep.period_s / 2, sweep.ramp_s, sweep.accel_deg_s2
    corners = [0, ramp, half - ramp, half, half + ramp, 2 * half - ramp, 2 * half]
    speed = a * sum(s * np.maximum(t - c, 0) for s, c in zip([1, -1, -1, 0, 1, 1, -1], corners, strict=True))
    middle = sweep.limits_deg[0] + np.concatenate([[0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t))])
    assume(np.ptp(sweep.limits_deg) > 1e-6)
    step = a * (t[1] * t[1])  # what one step of the integration may miss at a corner
    np.testing.assert_allclose(np.degrees(sweep.angle_rad(t)), middle, atol=1e-9 + 10 * step)
    assert np.degrees(sweep.angle_rad(half)) == pytest.approx(sweep.limits_deg[1], abs=1e-9)


@given(sweeps(), st.floats(0, 1))
@settings(max_examples=60, deadline=None)
def test_time_and_angle_are_inverse_on_the_way_out(sweep, share):
    angle = np.radians(sweep.limits_deg[0] + share * np.ptp(sweep.limits_deg))
    assert sweep.angle_rad(sweep.time_s(angle)) == pytest.approx(angle, abs=1e-9)
    t = share * sweep.period_s
    assert sweep.angle_rad(sweep.period_s - t) == pytest.approx(sweep.angle_rad(t), abs=1e-9)


def test_a_sweep_that_cannot_be_done_says_how_long_it_takes():
    with pytest.raises(ValidationError, match=r"take 3\.79 s at least"):
        Sweep(limits_deg=(-90, 90), period_s=3.0, accel_deg_s2=200.0)
    with pytest.raises(ValidationError, match="the first must be below the second"):
        Sweep(limits_deg=(90, -90), period_s=3.0)
    with pytest.raises(ValidationError, match="the first must be below the second"):
        Sweep(limits_deg=(10, 10), period_s=3.0)
    with pytest.raises(ValidationError, match=r"0\.1 deg wide at least"):
        Sweep(limits_deg=(0, 1e-7), period_s=3.0)


def counts_over_phases(lines, setting, directions, ball, phases):
    """Slow and obvious: a simulated scan for every start phase, and the kd-tree."""
    scans = (scan_at(FAN, lines.angles_rad((i + 0.5) / phases), setting) for i in range(phases))
    return np.stack([ball_search(scan, directions, ball) for scan in scans])


SWEEPS = [((-180, 180), 7.3), ((-20, 150), 4.0), ((30, 30.2), 2.0), ((-90, 90), 9.7), ((-180, -100), 3.3)]


@pytest.mark.parametrize("limits, period", samples(SWEEPS, SWEEPS[:3]))
def test_a_sweep_counts_what_simulated_scans_hold(limits, period):
    lines = SweepLines(Sweep(limits_deg=limits, period_s=period, accel_deg_s2=400.0), 10.0)
    setting, ball, phases = np.radians([20, -40, 60, 20]), np.radians(4), 200
    directions = spiral(60)
    counts = counts_over_phases(lines, setting, directions, ball, phases)
    in_rot = directions @ R_world_rot(*setting[:2])
    beams = beam_directions_rot(FAN, *setting[2:])
    z = phase_statistics_swept(in_rot, beams, lines, ball, log_density)
    # each of the windows that a direction has moves the mean by less than one phase
    np.testing.assert_allclose(z.mean, counts.mean(axis=0), atol=0.25)
    np.testing.assert_allclose(z.mean_g, log_density(counts).mean(axis=0), atol=0.02)
    assert (z.least <= counts.min(axis=0)).all() and (z.most >= counts.max(axis=0)).all()
    assert (z.least >= counts.min(axis=0) - 2).all()
    np.testing.assert_allclose(mean_count_swept(in_rot, beams, lines, ball), z.mean, atol=1e-9)


def test_all_beams_of_a_sweep_are_somewhere():
    """The integral of the mean density is beams times scans times the solid angle of the ball."""
    lines = SweepLines(Sweep(limits_deg=(-70, 100), period_s=6.35, accel_deg_s2=300.0), 10.0)
    ball = np.radians(5)
    found = mean_count_swept(spiral(20_000), beam_directions_rot(FAN, 0.4, -0.7), lines, ball).mean()
    assert found == pytest.approx(lines.scans * len(FAN) * (1 - np.cos(ball)) / 2, rel=2e-3)
    assert lines.scans == pytest.approx(63.5)


@pytest.fixture(scope="module")
def indoor():
    return problem_of(load_task(Path("indoor_urg")))


@pytest.mark.parametrize("setting", [(0, 90, 80, -90), (0, 20, -40, 10)])
def test_J_of_a_sweep_is_that_of_the_ball_search(indoor, setting):
    found, ball = score(indoor, np.radians(setting)), ball_score(indoor, np.radians(setting), 2000)
    assert abs(found.J - ball.J) < found.J_error + ball.J_error
    assert found.J_error <= 1e-3
    assert found.J_lower <= found.J + found.J_error


def test_what_a_sweep_leaves_blind(indoor):
    setting = np.radians([0, 90, 80, -90])
    directions = spiral(4000)
    scan = scan_at(indoor.bearings_rad, indoor.sweep.angles_rad(0.5), setting)
    seen = ball_search(scan, directions, indoor.ball_rad) > 0
    assert coverage(indoor, setting).blind_fraction == pytest.approx(
        (~seen[~indoor.field.masked_at(directions)]).mean(), abs=0.02
    )
    found = gaps(indoor, setting)
    steps = np.degrees(np.diff(indoor.sweep.angles_rad(0.5)))
    assert found.line_gap_deg == pytest.approx(np.abs(steps).max(), rel=1e-3)  # the fan reaches the equator
    assert found.half_turn_misses is None
    cap = empty_cap(scan)
    beams = np.degrees(np.arccos(np.clip(scan @ np.array(cap.axis_world), -1, 1)))
    assert beams.min() == pytest.approx(cap.half_angle_deg, abs=1e-6)  # nothing inside
    nearest = cKDTree(scan).query(spiral(20_000))[0].max()  # and nowhere a wider one
    assert np.degrees(2 * np.arcsin(nearest / 2)) <= cap.half_angle_deg + 1e-6


def test_stop_and_go_measures_each_line_again_and_again():
    lines = motion_lines(StopAndGo(stops=180, dwell_s=0.1), 40.0)
    assert (lines.count, lines.repeats, lines.step_rad) == (180, 4, pytest.approx(np.radians(2)))
    problem = problem_of(load_task(Path("uniform")))
    setting = np.radians([0, 90, 0, -90])  # nothing blind
    once = score(
        problem.with_beams(problem.bearings_rad, motion_lines(StopAndGo(stops=180, dwell_s=0.025), 40.0)), setting
    )
    again = problem.with_beams(problem.bearings_rad, lines)
    four, ball = score(again, setting), ball_score(again, setting, 2000)
    assert four.least == 4 * once.least
    assert abs(four.J - ball.J) < four.J_error + ball.J_error
    assert once.J - np.log(4) < four.J < once.J


def test_a_lever_arm_at_a_range_is_where_the_beams_end():
    """A simulated scan with the optical centre off the axis, its points at one range seen from the axis."""
    problem = replace(problem_of(load_task(Path("uniform"))), lever=(0.02, -0.01, 0.0))
    setting = np.radians([20, -40, 60, 20])
    lines = problem.lines.angles_rad[::40]
    R = R_world_rot(*setting[:2], lines)
    beams = beam_directions_rot(problem.bearings_rad, *setting[2:])
    ends = np.einsum("kij,bj->kbi", R, beams * 2.0 + np.array([0.04, -0.02, 0.0])).reshape(-1, 3)  # at 2 m
    np.testing.assert_allclose(
        scan_at(problem.bearings_rad, lines, setting, problem.lever),
        ends / np.linalg.norm(ends, axis=1, keepdims=True),
        atol=1e-12,
    )
    found, ball = score(problem, setting), ball_score(problem, setting, 2000)
    assert abs(found.J - ball.J) < found.J_error + ball.J_error + 1e-3
    assert abs(found.J - score(replace(problem, lever=(0.0, 0.0, 0.0)), setting).J) > found.J_error

"""Gaps, seams and crossings in closed form against counts on simulated scans."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scans import simulated_scan
from scipy.spatial import ConvexHull

from scanwright.design.density.ball_count import ball_count
from scanwright.design.density.beams import ScanLines, beam_directions_rot, scan_lines
from scanwright.design.errors import TaskError
from scanwright.design.evaluation.gaps import _in_field_of_view, empty_cap, gaps, interlaced_period_s
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import problem_of
from scanwright.design.search.shortest_period import shortest_period_s
from scanwright.design.sphere.directions import spiral
from scanwright.design.task.task import load_task

SETTINGS = [(0, 90, 0, -90), (-90, 0, 90, 0), (10, 20, -50, 35), (0, 0, 45, 0), (200, -30, 70, -60), (0, 0, 0, 0)]


@pytest.fixture(scope="module")
def uniform():
    return problem_of(load_task(Path("uniform")))


@pytest.fixture(scope="module")
def ground():
    return problem_of(load_task(Path("ground_ahead")))


def seen(bearings, lines, angles, directions, radius):
    return ball_count(simulated_scan(bearings, lines, angles), directions, radius) > 0


@pytest.mark.parametrize("angles_deg", SETTINGS)
def test_half_a_turn_against_a_simulated_one(uniform, angles_deg):
    angles = np.radians(angles_deg)
    directions = spiral(6000)
    lines = ScanLines(1440, 2 * np.pi / 1440)
    half = ScanLines(720, lines.step_rad)
    radius = np.radians(0.3)  # a few beams: blurs every edge by 0.3 deg
    full = seen(uniform.bearings_rad, lines, angles, directions, radius)
    missed = full & ~seen(uniform.bearings_rad, half, angles, directions, radius)
    assert gaps(uniform, angles).half_turn_misses == pytest.approx(missed.mean(), abs=0.012)


@pytest.mark.parametrize("first_deg", [-120.0, -90.0, 0.0])
@pytest.mark.parametrize("off_rad", [-1e-17, 0.0, 1e-17])
def test_a_bearing_on_the_seam_of_a_turn_is_one_of_the_fan(first_deg, off_rad):
    bearings = np.radians(first_deg + np.arange(0.0, 240.0, 30.0))
    asked = np.array([[off_rad, -2 * np.pi + off_rad, 2 * np.pi + off_rad], [np.pi, np.radians(first_deg - 20), np.pi]])
    expected = [[True, True, True], [first_deg > -120.0 + 60, False, first_deg > -120.0 + 60]]
    np.testing.assert_array_equal(_in_field_of_view(bearings, asked), expected)


@pytest.mark.parametrize("angles_deg", SETTINGS[:4])
def test_the_hole_of_a_fan_is_not_taken_for_seen(uniform, angles_deg):
    bearings = uniform.bearings_rad[np.abs(uniform.bearings_rad - 0.3) > np.radians(25)]
    holed = replace(uniform, bearings_rad=bearings)
    angles = np.radians(angles_deg)
    directions = spiral(6000)
    lines = ScanLines(1440, 2 * np.pi / 1440)
    radius = np.radians(0.3)
    full = seen(bearings, lines, angles, directions, radius)
    missed = full & ~seen(bearings, ScanLines(720, lines.step_rad), angles, directions, radius)
    assert gaps(holed, angles).half_turn_misses == pytest.approx(missed.mean(), abs=0.012)


@pytest.mark.parametrize("angles_deg", SETTINGS[:5])
def test_seen_twice_against_lines_that_come_by(uniform, angles_deg):
    """A direction is seen twice where its small ball is entered in two separate parts of the turn."""
    angles = np.radians(angles_deg)
    directions = spiral(300)
    radius = np.radians(0.4)
    R = R_world_rot(angles[0], angles[1], np.radians(np.arange(0, 360, 0.4)))
    beams = beam_directions_rot(uniform.bearings_rad, angles[2], angles[3])
    hit = np.stack([(directions @ (r @ beams.T)).max(axis=1) >= np.cos(radius) for r in R])
    visits = (hit & ~np.roll(hit, 1, axis=0)).sum(axis=0)
    assert gaps(uniform, angles).seen_twice == pytest.approx((visits >= 2).mean(), abs=0.03)


def test_the_figures_of_the_standard_alignments(uniform):
    """Rolling alone is complete after half a turn (paper, section 4); shares: algorithms, section 0."""
    rolling, pitching = (gaps(uniform, np.radians(a)) for a in SETTINGS[:2])
    assert rolling.half_turn_misses == pytest.approx(0, abs=1e-9)
    assert rolling.blind_cones[0].half_angle_deg == pytest.approx(45)
    assert rolling.blind_cones[0].axis_world == pytest.approx((-1, 0, 0))
    assert rolling.seen_twice == pytest.approx((1 + np.cos(np.radians(45))) / 2, abs=1e-3)
    assert pitching.blind_cones == ()
    assert pitching.seen_twice == pytest.approx(1 - np.cos(np.radians(45)), abs=2e-3)
    assert rolling.line_gap_deg == pitching.line_gap_deg == pytest.approx(0.5)
    assert gaps(uniform, np.radians(SETTINGS[3])).line_gap_deg == pytest.approx(0.5 * np.sin(np.radians(45)))


def test_blind_cones_are_the_largest_empty_caps(uniform):
    """The facets of the convex hull of all beams are the empty caps (Delaunay on the sphere)."""
    angles = np.radians((0, 0, 50, -35))
    hull = ConvexHull(simulated_scan(uniform.bearings_rad[::4], scan_lines(9.0, 40.0), angles))
    largest = np.degrees(np.arccos(-hull.equations[:, 3].max()))
    assert gaps(uniform, angles).blind_cones[0].half_angle_deg == pytest.approx(largest, abs=0.05)


def test_lines_cross_at_twice_the_tilt_on_the_equator(uniform):
    """A band one degree wide about the equator of an upright axis; the plane is tilted by 40 deg."""
    task = load_task(Path("uniform"))
    region = [{"shape": "band", "theta_deg": [89.5, 90.5]}]
    narrow = task.task.model_validate(task.task.model_dump() | {"weight": region})
    problem = uniform.with_objective(problem_of(replace(task, task=narrow)).objective)
    assert gaps(problem, np.radians((0, 0, 0, -40))).crossing_deg == pytest.approx(80, abs=0.1)
    assert gaps(problem, np.radians((0, 0, 0, 70))).crossing_deg == pytest.approx(40, abs=0.1)


@pytest.mark.parametrize("least", [1, 20])
def test_the_shortest_period_by_simulation(ground, least):
    angles = np.radians((0, 0, -50, 35))
    period = shortest_period_s(ground, angles, 40.0, least)
    directions = spiral(40_000)
    directions = directions[ground.field.weight_at(directions) > 0]

    def lowest(lines):
        phases = lines.step_rad * np.arange(4) / 4
        scans = [simulated_scan(ground.bearings_rad, lines, angles, phase) for phase in phases]
        return min(ball_count(scan, directions, ground.ball_rad).min() for scan in scans)

    assert lowest(scan_lines(period, 40.0)) >= least
    assert lowest(scan_lines(period * 0.9, 40.0)) < least


@pytest.mark.parametrize("seed", range(4))
def test_the_largest_empty_cap_by_trying_directions(seed):
    """Beams all around, on one side, and in one plane: a full circle of a cone, and a part of it."""
    rng = np.random.default_rng(seed)
    tried = spiral(50_000)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    around, up = np.linspace(0, rng.uniform(0.5, 6.2), 200), rng.choice([0.0, 0.3, -0.8])
    arc = np.stack([np.cos(around) * np.cos(up), np.sin(around) * np.cos(up), np.full(200, np.sin(up))], axis=1)
    for beams in (rng.normal(size=(300, 3)), 0.4 * rng.normal(size=(200, 3)) + [1, 0, 0], arc @ turn):
        scan = beams / np.linalg.norm(beams, axis=1, keepdims=True)
        cap = empty_cap(scan)
        nearest = np.degrees(np.arccos(np.clip((scan @ np.array(cap.axis_world)).max(), -1, 1)))
        assert cap.half_angle_deg == pytest.approx(nearest, abs=1e-3)
        widest = np.degrees(np.arccos(np.clip((tried @ scan.T).max(axis=1).min(), -1, 1)))
        assert widest - 1e-3 <= cap.half_angle_deg <= widest + 1.5


def test_a_blind_region_has_no_shortest_period(uniform):
    with pytest.raises(TaskError, match="blind"):
        shortest_period_s(uniform, np.radians((0, 90, 0, -90)), 40.0, 1)


def test_interlaced_turns_halve_the_gap():
    period = interlaced_period_s(18.0, 40.0)
    lines = scan_lines(period, 40.0)
    second = (np.arange(lines.count, 2 * lines.count) * lines.step_rad) % (2 * np.pi)
    both = np.sort(np.concatenate([lines.angles_rad, second]))
    assert np.diff(both).max() == pytest.approx(lines.step_rad / 2)

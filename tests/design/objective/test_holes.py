"""Where a setting is blind, against directions asked one by one, and in words."""

from pathlib import Path

import numpy as np
import pytest
from scans import simulated_scan

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.density.beams import blind_zones
from scanwright.design.density.spin import ball_search
from scanwright.design.objective.holes import BlindSpot, heading, holes, percent
from scanwright.design.objective.problem import problem_of
from scanwright.design.sphere.directions import weighted_samples
from scanwright.design.task.task import LoadedTask, Task

GROUND_AHEAD_PLAIN = np.radians([0, -55, -80, 75])


def problem(**more):
    table = {
        "name": "t",
        "sensor": "UTM-30LX",
        "servo": "MX-64R",
        "motion": {"period_s": 18.0},
        "weight": [{"shape": "band", "theta_deg": [95, 150], "phi_deg": [-60, 60]}],
    }
    return problem_of(LoadedTask(Task.model_validate(table | more), Path("t.toml"), load_catalogue(), ()))


def test_a_blind_cone_is_where_no_ball_holds_a_beam():
    task = problem()
    (hole,) = holes(task, GROUND_AHEAD_PLAIN)
    samples = weighted_samples(task.field, 150_000)
    scan = simulated_scan(task.bearings_rad, task.lines, GROUND_AHEAD_PLAIN)
    near = np.arccos(np.clip(samples.directions @ np.array(hole.centre), -1, 1)) < np.radians(5)
    none = ball_search(scan, samples.directions[near], task.ball_rad) == 0
    off = np.degrees(np.arccos(np.clip(samples.directions[near] @ np.array(hole.centre), -1, 1)))
    assert (off[none] <= hole.half_angle_deg + 0.02).all() and (off[~none] >= hole.half_angle_deg - 0.02).all()
    assert hole.weight == pytest.approx(samples.weights[near][none].sum() / samples.weights.sum(), rel=0.3)
    assert hole.words().startswith("blind ahead and 35 deg down: 0.58 deg about (0.819, 0.000, -0.574)")


def test_a_setting_without_a_hole_has_none():
    assert holes(problem(), np.radians([0, -55, -80, 80])) == ()


def test_the_half_that_a_sweep_never_turns_to_is_a_hole():
    sweep = {"mode": "sweep", "limits_deg": [-45, 45], "period_s": 6.0, "accel_deg_s2": 400.0}
    task = problem(motion=sweep, weight=[{"shape": "all"}], density={"tolerance": 0.1})
    (hole,) = holes(task, np.radians([0, 0, 0, 90]))
    assert 0.2 < hole.weight < 0.8


def test_where_beams_are_missing_from_the_middle_a_ring_is_blind():
    bearings = np.radians(np.arange(0, 90.0))
    seen = (bearings < np.radians(30)) | (bearings > np.radians(50))
    zones = np.degrees(blind_zones(bearings[seen], bearings[seen], np.radians(2.0)))
    np.testing.assert_allclose(zones, [[31, 49], [91, 180]])
    assert len(blind_zones(bearings, bearings, np.radians(0.1))) == 1, "between its beams a fan is continuous"


@pytest.mark.parametrize(
    "direction, words",
    [
        ((1, 0, 0), "ahead"),
        ((0, 1, 0), "to the left"),
        ((-1, -1, 0), "behind on the right"),
        ((0, 0, -1), "straight down"),
        ((0.8, 0, 0.6), "ahead and 37 deg up"),
    ],
)
def test_a_direction_in_words(direction, words):
    assert heading(np.array(direction, float) / np.linalg.norm(direction)) == words


@pytest.mark.parametrize("share, words", [(0, "0%"), (1e-7, "below 0.0001%"), (0.000195, "0.019%"), (0.134, "13.4%")])
def test_a_share_that_is_there_is_never_written_as_nothing(share, words):
    assert percent(share) == words


def test_a_direction_has_no_negative_zero():
    assert "about (-0.819, 0.000, 0.574)" in BlindSpot((-0.819, -1e-4, 0.574), 30.0, 0.0, 0.1).words()

"""Stated errors of J, few nodes against many: they hold, and they are not far too large, for turns and for sweeps."""

from pathlib import Path

import numpy as np
import pytest

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score_on
from scanwright.design.objective.stated_error import error_words, rounded_to_error
from scanwright.design.task.task import LoadedTask, Task

AHEAD = {"shape": "band", "theta_deg": [60, 140], "phi_deg": [-50, 50]}
SPIN = {"period_s": 2.0}
SWEEP = {"mode": "sweep", "period_s": 2.0, "limits_deg": [-70, 70]}


def problem(motion, **density):
    task = {
        "name": "t",
        "sensor": "URG-04LX",
        "servo": "MX-64R",
        "motion": motion,
        "weight": [AHEAD],
        "density": density,
    }
    return problem_of(LoadedTask(Task.model_validate(task), Path(), load_catalogue(), ()))


def shares_of_the_stated(p, few, many, count, seed):
    """True error over the stated one, signed, at random settings."""
    rng = np.random.default_rng(seed)
    shares = []
    for _ in range(count):
        setting = np.radians(rng.uniform([-180, -90, -90, -90], [180, 90, 90, 90]))
        rough = score_on(p, setting, few)
        shares.append((rough.J - score_on(p, setting, many).J) / rough.J_error)
    return np.array(shares)


def test_of_a_turn_they_hold_on_few_nodes():
    shares = shares_of_the_stated(problem(SPIN, objective="log", ball_radius_deg=1.0), 81, 6561, 15, 3)
    assert abs(shares).max() < 1


def test_they_are_a_few_times_the_true_ones():
    shares = shares_of_the_stated(problem(SPIN, objective="log", ball_radius_deg=2.0), 2187, 19_683, 12, 4)
    assert 0.1 < np.median(abs(shares)) and abs(shares).max() < 1


def test_of_a_step_between_two_nodes_they_hold():
    p = problem(SPIN, objective="required", required=12, ball_radius_deg=2.0)
    assert abs(shares_of_the_stated(p, 27, 6561, 30, 5)).max() < 1


def test_of_a_sweep_they_are_those_of_a_mean_of_independent_sets():
    shares = shares_of_the_stated(problem(SWEEP, objective="log", ball_radius_deg=2.0), 800, 16_000, 16, 7)
    assert abs(shares).max() < 1
    assert 0.08 < np.sqrt(np.mean(shares**2)) < 0.5  # a standard error is a 4.5th of what is stated


@pytest.mark.parametrize("motion", [SPIN, SWEEP])
def test_a_lowest_count_is_at_least_one_uncertain(motion):
    p = problem(motion | {"period_s": 20.0}, objective="worst", ball_radius_deg=4.0)
    found = score_on(p, np.radians([0.0, 0.0, 90.0, 0.0]), 1600)
    assert found.least > 1 and found.J_error >= np.log1p(found.least) - np.log1p(found.least - 1)


@pytest.mark.parametrize(
    ("value", "error", "expected"),
    [(-6.128414, 5.5e-5, (-6.12841, 6e-5)), (1.0, 0.0, (1.0, 0.0)), (-5.29596, 9.96e-5, (-5.29596, 1e-4))],
)
def test_a_figure_is_rounded_to_its_error(value, error, expected):
    assert rounded_to_error(value, error) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("value", "error", "told"),
    [(-6.12764, 1.486e-4, "2e-04"), (-6.12764, 4.9e-4, "6e-04"), (0.0, 0.0, "0e+00"), (-5.823463, 7.01e-5, "8e-05")],
)
def test_a_bound_is_never_told_smaller_than_it_is(value, error, told):
    assert error_words(value, error) == told
    assert float(told) >= error

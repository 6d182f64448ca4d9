"""Holes and limits as constraints of the whole grid, against a loop over every setting of it."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.objective.holes import NO_BLIND_WEIGHT
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import Score, score, score_on
from scanwright.design.scene.surface import cell_directions
from scanwright.design.search import families, refinement
from scanwright.design.search.constraints import fan_reach
from scanwright.design.search.search import search
from scanwright.design.search.space import SearchSpace
from scanwright.design.sphere.directions import weighted_samples
from scanwright.design.sphere.outline import reach_about
from scanwright.design.sphere.polar_rule import has_all_breaks
from scanwright.design.task.angle_ranges import NAMES, AngleRanges
from scanwright.design.task.task import Limits, LoadedTask, Task

AHEAD = {"shape": "band", "theta_deg": [95, 140], "phi_deg": [-50, 50]}
CONE = {"shape": "cone", "axis": [1, 0.3, -0.4], "half_angle_deg": 12}
RANGES = {  # where the lowest J has a hole, and a tenth of a percent above it there is none
    "alpha_rot_deg": 0,
    "beta_rot_deg": [-60, -50],
    "alpha_laser_deg": [-90, -70],
    "beta_laser_deg": [60, 90],
    "step_deg": 5,
}
SWEEP = {
    "sensor": "URG-04LX",
    "servo": "AX-12A",
    "motion": {"mode": "sweep", "limits_deg": [-60, 60], "period_s": 6.0, "accel_deg_s2": 400.0},
    "angles": {"alpha_rot_deg": 0, "beta_rot_deg": [-90, 0], "alpha_laser_deg": [0, 90], "step_deg": 45},
    "density": {"ball_radius_deg": 4.0, "tolerance": 0.05},
}


@pytest.fixture(autouse=True)
def few_families(monkeypatch):
    """Nobody looks at the answers behind the first ones."""
    monkeypatch.setattr(families, "FAMILIES", 3)


def loaded(**more):
    table = {
        "name": "t",
        "sensor": "UTM-30LX",
        "servo": "MX-64R",
        "slip_ring": "UH1256-02-0610-06S",
        "motion": {"period_s": 4.0},
        "angles": RANGES,
        "weight": [AHEAD],
    }
    return LoadedTask(Task.model_validate(table | more), Path("t.toml"), load_catalogue(), ())


def every_score(task):
    problem, ranges = problem_of(task), task.task.angles
    grid = np.array(list(product(*(ranges.grid_deg(name) for name in NAMES))))
    return [score_on(problem, setting, 729) for setting in np.radians(grid)]


@pytest.mark.parametrize(
    "task, limits",
    [
        (loaded(), Limits()),
        (loaded(weight=[AHEAD, CONE], density={"objective": "homogeneity"}), Limits()),
        (loaded(), Limits(min_density=52)),
        (loaded(angles=RANGES | {"holes": "allow"}), Limits(max_blind_weight=2e-4)),
        (loaded(**SWEEP), Limits()),
    ],
    ids=["holes", "holes, another objective", "density", "blind weight", "holes of a sweep"],
)
def test_the_best_that_keeps_them_is_the_best_of_the_grid_that_does(task, limits, monkeypatch):
    monkeypatch.setattr(families, "MOST_RUNS", (0, 0, 0))
    problem = problem_of(task)
    found = search(problem, task.task.angles, limits=limits)
    blind = limits.max_blind_weight or (NO_BLIND_WEIGHT if task.task.angles.holes == "avoid" else 1.0)
    everything = every_score(task)
    within = [s for s in everything if s.blind_weight <= blind and s.least >= (limits.min_density or 0)]
    best = min(within, key=lambda s: s.J)
    assert min(everything, key=lambda s: s.J).J < best.J, "nothing to constrain: the test proves nothing"
    assert found.best[0].score.J <= best.J + 3e-3, "unrefined, the coarse J of two neighbours may be in another order"
    for family in found.best:
        assert family.score.blind_weight <= blind and family.score.least >= (limits.min_density or 0)


def test_refined_and_rounded_it_still_has_no_hole_and_the_plain_optimum_is_told():
    task = loaded()
    problem = problem_of(task)
    found = search(problem, task.task.angles)
    assert found.best[0].score.blind_weight <= NO_BLIND_WEIGHT
    assert found.plain.score.blind_weight > 0
    assert found.plain.score.J < found.best[0].score.J
    allowed = search(problem, task.task.angles.model_copy(update={"holes": "allow"}))
    assert allowed.plain is None
    assert allowed.best[0].score.J == pytest.approx(found.plain.score.J, abs=3 * allowed.best[0].score.J_error)


def test_a_minimum_that_all_nodes_refuse_is_left_for_the_nearest_place_on_the_way_back_to_its_leader():
    """At the edge of what is allowed few nodes may pass what all of them do not: the whole refinement was lost then."""
    leader, refined = np.zeros(4), np.array([4.0, -2.0, 1.0, 0.0])
    kept = Score(J=-1.0, J_error=1e-4, J_lower=-1.1, least=1, blind_weight=0.0)

    class Edge(SearchSpace):
        def score(self, angles_deg):
            return kept if angles_deg[0] <= 3.5 else None

    edge = Edge(problem_of(loaded()), AngleRanges(), Limits(), True)
    setting, found = refinement.allowed_setting(edge, refined, leader)
    assert found == kept and setting.tolist() == [3.4, -1.7, 0.85, 0.0]
    assert refinement.allowed_setting(edge, refined + 9, leader + 9)[1] is None


@pytest.mark.parametrize("seed", range(2))
def test_a_walk_ends_where_a_fan_no_longer_reaches_a_corner_of_a_painted_region(seed):
    """Walks went on until directions that represent the region were missed: the way back cost 1e-3 of J."""
    rng = np.random.default_rng(seed)
    cells = cell_directions(4.0)
    centres = rng.normal(size=(6, 3))
    reach = np.cos(np.radians(rng.uniform(5, 25, 6))) * np.linalg.norm(centres, axis=1)
    table = (cells @ centres.T >= reach).any(axis=2).astype(float)
    task = replace(loaded(weight=[{"shape": "map", "file": "discs.npy"}]), maps=(table,))
    space = SearchSpace(problem_of(task), AngleRanges(), Limits(), True)
    assert not has_all_breaks(space.problem.field)
    settings = rng.uniform([-180, -90, -90, -90], [180, 90, 90, 90], (30, 4))
    seen = np.array([np.isfinite(space.J(setting, 81)) for setting in settings])
    inside, outside = settings[seen][0], settings[~seen][0]
    for _ in range(12):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if space.score(middle) else (inside, middle)
    assert np.isfinite(space.J(inside, 81)) and np.isinf(space.J(outside, 81))


def test_where_nothing_is_free_of_holes_the_smallest_share_is_told(monkeypatch):
    monkeypatch.setattr(families, "MOST_RUNS", (0, 0, 0))
    task = loaded(weight=[{"shape": "all"}], angles=RANGES | {"beta_laser_deg": [60, 70]})
    found = search(problem_of(task), task.task.angles)
    everything = every_score(task)
    assert found.least_blind == pytest.approx(min(s.blind_weight for s in everything), abs=1e-5)
    assert found.best[0].score.J <= min(s.J for s in everything) + 1e-3


@pytest.mark.parametrize("weight", [[AHEAD], [CONE, AHEAD | {"phi_deg": [100, 130]}], [{"shape": "all"}]])
def test_what_a_region_reaches_about_an_axis(weight):
    field = problem_of(loaded(weight=weight, mask=[CONE | {"axis": [1, 0, -1]}])).field
    axes = np.random.default_rng(1).normal(size=(40, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    polar = np.arccos(np.clip(axes @ weighted_samples(field, 60_000).directions.T, -1, 1))
    lowest, highest = reach_about(field, axes).T
    assert (lowest <= polar.min(axis=1) + 1e-9).all() and (highest >= polar.max(axis=1) - 1e-9).all()
    assert (polar.min(axis=1) - lowest).max() < np.radians(1.0) and (highest - polar.max(axis=1)).max() < np.radians(
        1.0
    )


def test_the_reach_of_a_fan_is_that_of_its_beams():
    problem = problem_of(loaded())
    planes = np.radians([[0, -60], [35, 20], [90, 0]])
    for plane, (low, high) in zip(planes, fan_reach(problem, planes), strict=True):
        polar = np.arccos(problem.beams_rot(plane)[:, 2])
        assert (low, high) == pytest.approx((polar.min() - problem.ball_rad, polar.max() + problem.ball_rad))


@pytest.mark.parametrize("half_angle_deg", [0.001, 0.05])
@pytest.mark.parametrize("axis", [[0, 0, 1], [0.4, 0.2, -0.6]], ids=["pole", "oblique"])
def test_a_region_smaller_than_any_step_of_the_search_is_found(axis, half_angle_deg, monkeypatch):
    monkeypatch.setattr(families, "MOST_RUNS", (0, 0, 0))
    tiny = {"shape": "cone", "axis": axis, "half_angle_deg": half_angle_deg}
    rough = {"angles": {"step_deg": 30}, "density": {"tolerance": 0.05}}
    task = loaded(weight=[tiny], **rough)
    found = search(problem_of(task), task.task.angles)
    alike = loaded(weight=[tiny | {"half_angle_deg": 0.5}], **rough)
    assert found.best[0].score.J <= search(problem_of(alike), alike.task.angles).best[0].score.J + 0.05


def test_a_small_region_of_a_sweep_is_found(monkeypatch):
    monkeypatch.setattr(families, "MOST_RUNS", (0, 0, 0))
    task = loaded(**SWEEP | {"weight": [CONE | {"half_angle_deg": 0.3}]})
    found = search(problem_of(task), task.task.angles)
    assert found.best[0].score.J < 0 and found.best[0].score.blind_weight == 0


@pytest.mark.parametrize("ball_radius_deg", [0.9, 1.5, 1.75])
def test_the_coarse_J_counts_the_equator_once(ball_radius_deg, monkeypatch):
    """4 pi / ball + 1 nodes were even for these, and the node in the middle counted one and a half times."""
    monkeypatch.setattr(families, "MOST_RUNS", (0, 0, 0))
    task = loaded(
        weight=[CONE | {"half_angle_deg": 2}],
        density={"ball_radius_deg": ball_radius_deg},
        angles={"step_deg": 15, "holes": "allow"},
    )
    problem = problem_of(task)
    planes = search(problem, task.task.angles).planes
    row = planes[planes[:, 2].argmin()]
    assert row[2] == pytest.approx(score(problem, np.radians(row[[3, 4, 0, 1]])).J, abs=0.15)

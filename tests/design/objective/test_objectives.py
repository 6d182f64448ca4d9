"""Objectives: each against the ball search on simulated scans, its bound, its search, and what it stands for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import TaskError
from scanwright.design.objective.ball_search import ball_score
from scanwright.design.objective.counted import counted_J
from scanwright.design.objective.named_objectives import Moment, homogeneity, kl, worst
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import quick_J, score
from scanwright.design.scene.surface import Surface, cell_directions
from scanwright.design.search import families
from scanwright.design.search.search import search
from scanwright.design.task.task import LoadedTask, Task

AHEAD = {"shape": "band", "theta_deg": [60, 120], "phi_deg": [-80, 80]}
GROUND = {"shape": "cone", "axis": [1, 0, -1], "half_angle_deg": 25, "value": 3.0}
SETTINGS = [(0, 90, 0, -90), (30, -50, 20, 70), (0, 0, -50, 35), (-90, 10, 45, 30)]


def loaded(objective, regions=(AHEAD, GROUND), angles=None, **density):
    task = Task.model_validate(
        {
            "name": "t",
            "sensor": "UTM-30LX",
            "servo": "MX-64R",
            "slip_ring": "UH1256-02-0610-06S",
            "motion": {"period_s": 2.0},
            "angles": angles or {},
            "density": {"objective": objective} | density,
            "weight": list(regions),
        }
    )
    return LoadedTask(task, Path("t.toml"), load_catalogue(), ())


def problem(*args, **more):
    return problem_of(loaded(*args, **more))


CASES = {
    "log": lambda: problem("log"),
    "kl": lambda: problem("kl"),
    "homogeneity": lambda: problem("homogeneity"),
    "required, one level": lambda: problem("required", required=120),
    "required, levels": lambda: problem("required", (AHEAD | {"required": 60}, GROUND | {"required": 200})),
    "required, background": lambda: problem("required", (GROUND | {"required": 300},), background=0.1, required=40),
}


@pytest.mark.parametrize("name", CASES)
def test_each_objective_is_what_the_ball_search_finds(name):
    p = CASES[name]()
    setting = np.radians(SETTINGS[1])  # no focus point inside: few samples would hit it, and d^2 is all there
    found, ball = score(p, setting), ball_score(p, setting, 1000)
    assert abs(found.J - ball.J) < found.J_error + ball.J_error + 5e-4, name
    assert found.J_lower <= found.J + 1e-9
    assert found.J_error <= 1e-3
    assert quick_J(p, setting, 6561) == pytest.approx(found.J, abs=1e-3)


def test_the_worst_density_is_the_lowest_of_many_phases_and_directions():
    p = problem("worst")
    for setting in np.radians(SETTINGS[1:3]):
        found, ball = score(p, setting), ball_score(p, setting, 400)
        assert found.J == -np.log1p(found.least)
        assert found.J >= ball.J - 1e-12  # the ball search looks at fewer places


def test_no_weight_beyond_what_is_required_and_all_of_it_where_nothing_is():
    p = problem("required", required=1, ball_radius_deg=5.0)
    assert score(p, np.radians([0, 90, 0, -90])).J == pytest.approx(0.0, abs=1e-9)  # everything is seen once at least
    blind = problem("required", ({"shape": "cone", "axis": [0, 0, 1], "half_angle_deg": 5},), required=50)
    assert score(blind, np.radians([0, 0, 30, 0])).J == pytest.approx(1.0, abs=1e-9)


def test_kl_and_homogeneity_of_an_even_scan_are_those_of_its_statistics():
    """One weight: kl is mean(-ln q) for q = (1 + d) / mean(1 + d), homogeneity the log of mean(d^2) / mean(d)^2."""
    p = problem("log", (AHEAD,))
    setting = np.radians([0, 90, 0, -90])
    plain = score(p, setting).J

    def mean_of(g):
        return score(p.with_objective(replace(p.objective, moments=(Moment(p.field, g),))), setting).J

    mean, square = mean_of(np.positive), mean_of(np.square)
    by_kl = p.with_objective(kl(p.field, loaded("log", (AHEAD,))))
    assert score(by_kl, setting).J == pytest.approx(plain + np.log1p(mean), abs=1e-4)
    even = score(p.with_objective(homogeneity(p.field)), setting).J
    assert even == pytest.approx(np.log(square / mean**2), abs=1e-4)
    assert even >= 0


@pytest.mark.parametrize("objective", ["kl", "required"])
def test_the_papers_sum_weighs_all_that_it_joins_alike(objective):
    """Shares of the weight are sums over the nodes of the grid too: the level of a pole weighs as its nodes do."""
    up = {"shape": "band", "theta_deg": [0, 60], "value": 0.3, "required": 5.0}
    grid = {"quadrature": "equal_angle", "grid_step_deg": 5.0, "ball_radius_deg": 5.0, "required": 2000.0}
    task = loaded(objective, (up, GROUND), **grid)
    setting = np.radians(SETTINGS[1])
    found, counted = score(problem_of(task), setting), counted_J(task, setting, seed=1, points=2**12)
    assert found.J == pytest.approx(counted.J, abs=1e-3 + counted.J_error)


def test_each_level_of_a_scene_has_its_own_background():
    """What no region of a scene names belongs to one level of density only."""
    cells = cell_directions(10.0)
    shape = cells.shape[:2]
    wall = Surface(cells, np.full(shape, 2.0), np.zeros(shape), 2 * cells)
    cone = {"shape": "cone", "axis": [0, 0, 1], "half_angle_deg": 60, "value": 0.5, "required": 5.0}
    task = replace(loaded("required", (cone,), required=2000.0, background=0.5), surface=wall)
    setting = np.radians(SETTINGS[1])
    found, counted = score(problem_of(task), setting), counted_J(task, setting, seed=1, points=2**13)
    assert abs(found.J - counted.J) <= found.J_error + counted.J_error


def test_kl_is_lowest_where_the_density_follows_the_weights():
    """A region of weight 1 and one of weight 3: what has three times the density in the second one is nearer."""
    near = problem("kl")
    flat = problem("kl", (AHEAD, GROUND | {"value": 1.0}))
    J = np.array([[score(p, np.radians(s)).J for s in SETTINGS] for p in (near, flat)])
    assert (J > -1e-9).all()
    assert np.ptp(J[0] - J[1]) > 0.01


@pytest.mark.parametrize("name", ["kl", "worst"])
def test_no_random_setting_beats_the_search(name, monkeypatch):
    monkeypatch.setattr(families, "FAMILIES", 1)  # nobody looks at the ones behind
    coarse = {"step_deg": 30, "alpha_rot_deg": 0}
    regions = (AHEAD | {"required": 60}, GROUND | {"required": 200})
    task = loaded(name.split(",")[0], regions, coarse)
    p = problem_of(task)
    best = search(p, task.task.angles).best[0].score
    rng = np.random.default_rng(5)
    drawn = np.radians(rng.uniform([0, -90, -90, -90], [0, 90, 90, 90], (80, 4)))
    rough = np.array([quick_J(p, setting, 243) for setting in drawn])
    exact = [score(p, drawn[i]) for i in np.argsort(rough)[:4]]
    assert best.J <= min(s.J + s.J_error for s in exact) + best.J_error


def test_required_needs_a_number_for_every_region():
    with pytest.raises(TaskError, match=r"t.toml: density.objective = 'required': weight.1.required: set the number"):
        problem("required", (AHEAD | {"required": 60}, GROUND))
    with pytest.raises(TaskError, match="set the number of beams per ball"):
        problem("required", (GROUND | {"required": 3},), background=0.5)


def test_the_worst_of_a_region_in_two_parts_is_the_worse_part():
    parts = [AHEAD, {"shape": "cone", "axis": [0, 1, -1], "half_angle_deg": 10}]
    setting = np.radians([30, -50, 20, 70])
    alone = [score(problem("worst", (part,)), setting).least for part in parts]
    both = problem("log", parts)
    assert score(both.with_objective(worst(both.field)), setting).least == min(alone)


@pytest.mark.parametrize("masked", [False, True])
def test_kl_where_all_weighs_the_same_is_that_of_the_region_that_it_fills(masked):
    """The logarithms of equal weights are 0: nothing holds any, and among many edges of cells that is no error."""
    cells = np.zeros((90, 180))
    cells[30:60, 70:110] = 1.0  # theta 60 .. 120, phi 140 .. 220 deg
    drawn = {"shape": "map", "file": "cells.npy"}
    given = loaded("kl", [{"shape": "all"} if masked else drawn])
    if masked:
        given = replace(given, task=Task.model_validate(given.task.model_dump() | {"mask": [drawn]}))
    found = score(problem_of(replace(given, maps=(1 - cells if masked else cells,))), np.radians(SETTINGS[1]))
    filled = problem("kl", [{"shape": "band", "theta_deg": [60, 120], "phi_deg": [140, 220]}])
    painted = score(filled, np.radians(SETTINGS[1]))
    assert abs(found.J - painted.J) <= found.J_error + painted.J_error

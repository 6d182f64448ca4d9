"""Limits of a task, the shortest period that keeps them, and the optimum that bears a sloppy mount."""

import re
from pathlib import Path

import numpy as np
import pytest
from scans import simulated_scan

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.density.spin import ball_search
from scanwright.design.errors import TaskError
from scanwright.design.evaluation.evaluation import evaluate
from scanwright.design.evaluation.gaps import gaps
from scanwright.design.objective.ball_search import start_phases
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import quick_J, score
from scanwright.design.objective.tolerance import rise_words, sensitivity, worst_within
from scanwright.design.progress import no_progress
from scanwright.design.search import families
from scanwright.design.search import search as search_module
from scanwright.design.search.constraints import allowed_planes
from scanwright.design.search.grid_classes import fold_planes, mirrors_of
from scanwright.design.search.search import search
from scanwright.design.search.shortest_period import fastest
from scanwright.design.sphere.directions import weighted_samples
from scanwright.design.task.task import Limits, LoadedTask, Task, load_task

AHEAD = {"shape": "band", "theta_deg": [95, 140], "phi_deg": [-50, 50]}
ANGLES = {"alpha_rot_deg": 0, "beta_rot_deg": [-90, 90], "alpha_laser_deg": -80, "step_deg": 15}


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
        "motion": {"period_s": 6.0},
        "angles": ANGLES,
        "weight": [AHEAD],
    }
    return LoadedTask(Task.model_validate(table | more), Path("t.toml"), load_catalogue(), ())


def test_planes_that_break_a_limit_are_not_looked_at_and_the_others_all_are():
    task = loaded(angles={"step_deg": 15})
    problem = problem_of(task)
    planes = fold_planes(task.task.angles, mirrors_of(problem.bearings_rad))
    limits = Limits(max_line_gap_deg=1.3, max_blind_cone_deg=40)
    kept = {tuple(setting) for setting in allowed_planes(problem, planes, limits).settings_deg}
    assert 0 < len(kept) < len(planes.settings_deg)
    for setting in planes.settings_deg:
        found = gaps(problem, np.radians([0, 0, *setting]))
        cone = max((c.half_angle_deg for c in found.blind_cones), default=0.0)
        assert (tuple(setting) in kept) == (found.line_gap_deg <= 1.3 and cone <= 40)


def test_the_best_within_limits_is_the_best_of_those_that_keep_them():
    task = loaded(angles={"alpha_rot_deg": 0, "beta_laser_deg": [-90, 0], "step_deg": 45})
    problem = problem_of(task)
    free = search(problem, task.task.angles).best[0]
    limits = Limits(max_blind_cone_deg=gaps(problem, free.angles_rad).blind_cones[0].half_angle_deg - 3)
    bound = search(problem, task.task.angles, limits=limits).best[0]
    assert bound.score.J > free.score.J
    assert all(c.half_angle_deg <= limits.max_blind_cone_deg for c in gaps(problem, bound.angles_rad).blind_cones)
    grid = [np.radians([0, b, c, d]) for b in range(-90, 91, 45) for c in range(-90, 91, 45) for d in range(-90, 1, 45)]
    within = [
        s for s in grid if all(c.half_angle_deg <= limits.max_blind_cone_deg for c in gaps(problem, s).blind_cones)
    ]
    assert bound.score.J <= min(quick_J(problem, s, 729) for s in within) + 1e-3


@pytest.mark.parametrize(
    "limits, words",
    [
        ({"max_line_gap_deg": 0.01}, "limits.max_line_gap_deg = 0.01: the scan planes of this task reach"),
        (
            {"min_density": 5000},
            "min_density = 5000: no setting of the grid keeps them; the one of the lowest J has min_density",
        ),
    ],
)
def test_limits_that_nothing_keeps_say_what_can_be_had(limits, words):
    task = loaded()
    with pytest.raises(TaskError, match=words):
        search(problem_of(task), task.task.angles, limits=Limits.model_validate(limits))


@pytest.mark.parametrize("period_s", [5.0, 11.3])
def test_a_gap_limit_that_leaves_holes_names_the_period_without_them(period_s):
    """With that period the setting that is named keeps the limit, and some line less breaks it."""
    limits = Limits(max_line_gap_deg=0.4)
    task = loaded(motion={"period_s": period_s}, angles=ANGLES | {"alpha_laser_deg": [-80, 0]})
    with pytest.raises(TaskError, match=r"max_line_gap_deg = 0.4: .* has lines .* a period_s of \d") as refused:
        search(problem_of(task), task.task.angles, limits=limits)
    told = re.search(r"blind; \((.*)\) sees .* period_s of ([\d.]+);", str(refused.value))
    setting, longer_s = np.radians([float(angle) for angle in told[1].split(",")]), float(told[2])
    for longer, keeps in ((longer_s, True), (longer_s - 1 / 40, False)):
        slow = problem_of(loaded(motion={"period_s": longer}))
        assert (gaps(slow, setting).line_gap_deg <= 0.4 + 1e-9) == keeps
    assert score(problem_of(task), setting).blind_weight < 1e-9


def test_the_shortest_period_keeps_its_limit_in_simulated_scans():
    """At the period found every direction has the beams it must have at any phase; 15 % faster some has not."""
    task = loaded(motion={"period_s": "shortest", "longest_s": 12.0}, limits={"min_density": 12})
    now, problem, result = fastest(task, no_progress)
    assert now.task.motion.period_s < 12.0
    directions = weighted_samples(problem.field, 2500).directions

    def lowest(period_s):
        there = problem_of(loaded(motion={"period_s": period_s}))
        phases = start_phases(there.lines.count, there.lines.step_rad)
        scans = (simulated_scan(there.bearings_rad, there.lines, result.best[0].angles_rad, p) for p in phases)
        return min(ball_search(scan, directions, there.ball_rad).min() for scan in scans)

    assert result.best[0].score.least >= 12
    assert lowest(now.task.motion.period_s) >= 12
    assert lowest(now.task.motion.period_s * 0.85) < 12


def test_the_shortest_period_for_a_gap_is_the_one_that_makes_it():
    task = loaded(motion={"period_s": "shortest"}, limits={"max_line_gap_deg": 1.0})
    now, problem, result = fastest(task, no_progress)
    assert gaps(problem, result.best[0].angles_rad).line_gap_deg <= 1.0 + 1e-9
    one_less = problem_of(loaded(motion={"period_s": now.task.motion.period_s - 1 / 40}))
    assert gaps(one_less, result.best[0].angles_rad).line_gap_deg > 1.0


def test_evaluate_chooses_the_shortest_period_of_the_mount_that_it_shows():
    """At the period chosen the gap keeps its limit, one scan less breaks it; a mount that never can has longest_s."""
    task = loaded(motion={"period_s": "shortest", "longest_s": 12.0}, limits={"max_line_gap_deg": 1.0})
    for angles_deg in ((0, 90, 0, -90), (10, -40, -60, 50)):
        angles = np.radians(angles_deg)
        found = evaluate(task, angles, None, None, no_progress)
        assert found.gaps.line_gap_deg <= 1.0 + 1e-9
        assert found.facts()["period_s"] == found.shortest_s < 12.0
        one_less = problem_of(loaded(motion={"period_s": found.shortest_s - 1 / 40}))
        assert gaps(one_less, angles).line_gap_deg > 1.0
    hopeless = loaded(motion={"period_s": "shortest", "longest_s": 12.0}, limits={"min_density": 10_000})
    found = evaluate(hopeless, np.radians((0, 90, 0, -90)), None, None, no_progress)
    assert found.shortest_s == 12.0
    assert "12 s a turn" in "\n".join(found.lines())


def test_shortest_asks_for_a_limit(tmp_path):
    path = tmp_path / "t.toml"
    text = (Path(load_task(Path("uniform")).source)).read_text(encoding="utf-8")
    path.write_text(text.replace("period_s = 18.0", 'period_s = "shortest"'), encoding="utf-8")
    with pytest.raises(TaskError, match="'shortest': requires limits"):
        load_task(path)


def test_sensitivity_is_the_worse_of_both_ways():
    problem = problem_of(loaded())
    setting, off = np.radians([10, -40, -60, 50]), np.radians(1.0)
    found = sensitivity(problem, setting, off, 729)
    J = quick_J(problem, setting, 729)
    for i, name in enumerate(("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")):
        moved = [quick_J(problem, setting + sign * off * np.eye(4)[i], 729) for sign in (-1, 1)]
        assert found[name] == pytest.approx(max(moved) - J, abs=1e-12)
    assert worst_within(problem, setting, off, 729) == pytest.approx(J + max(0, *found.values()), abs=1e-12)


def test_with_a_tolerance_the_optimum_is_the_one_that_bears_it_best():
    narrow = ANGLES | {"beta_laser_deg": 30}
    plain, sloppy = loaded(angles=narrow), loaded(angles=narrow | {"tolerance_deg": 4.0})
    problem, off = problem_of(plain), np.radians(4.0)
    best = search(problem, plain.task.angles).best[0]
    robust = search(problem, sloppy.task.angles).best[0]
    assert "within 4 deg" in robust.word
    at = [worst_within(problem, family.angles_rad, off, 6561) for family in (robust, best)]
    assert at[0] <= at[1] + 1e-4


def test_a_rise_within_the_error_of_J_is_none():
    rises = {"alpha_rot": 0.0002, "beta_rot": 0.0101, "alpha_laser": -0.0001, "beta_laser": 0.0004}
    assert rise_words(rises, 3e-4) == (
        "J rises by 0.0101 (beta_rot), 0.0004 (beta_laser), by no more than its error (alpha_rot, alpha_laser)"
    )
    assert rise_words(rises, 1e-5).startswith("J rises by 0.0002 (alpha_rot), 0.0101")
    assert rise_words(rises, 0.02) == "J rises by no more than its error for every angle"


def test_a_region_that_no_setting_sees_is_told():
    task = loaded(
        weight=[{"shape": "cone", "axis": [0, 0, 1], "half_angle_deg": 3}],
        angles={"alpha_rot_deg": 0, "beta_rot_deg": 0, "alpha_laser_deg": 0, "beta_laser_deg": 0},
        density={"objective": "homogeneity", "ball_radius_deg": 1.0},
    )
    with pytest.raises(TaskError, match="no setting of the grid brings a beam near the region"):
        search(problem_of(task), task.task.angles)


def test_holes_between_the_nodes_of_every_setting_are_no_refusal(monkeypatch):
    """A task without limits has an answer where no setting is free of holes, even if none shows them at the nodes."""
    real = search_module.best_candidate

    def with_holes(land, space, **more):
        return None if space.avoid_holes else real(land, space, **more)

    task, told = loaded(angles=ANGLES | {"step_deg": 45}), []
    free = search(problem_of(task), task.task.angles)
    monkeypatch.setattr(search_module, "best_candidate", with_holes)
    found = search(problem_of(task), task.task.angles, lambda step, _=None: told.append(step))
    assert found.best[0].score.J <= free.best[0].score.J and found.least_blind is not None
    assert "no mount of the grid sees all of the region: the lowest J of all" in told

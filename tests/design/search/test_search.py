"""The folded search against an unfolded loop over every setting, and against settings drawn at random."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest

from design.catalogue.catalogue import load_catalogue
from design.concurrency import parallel
from design.frames import R_world_rot
from design.objective.problem import problem_of
from design.objective.score import quick_J, score
from design.search import coarse, families
from design.search.search import search
from design.task.task import NAMES, LoadedTask, Task, load_task, shipped_tasks

AHEAD = {
    "weight": [{"shape": "band", "theta_deg": [95, 150], "phi_deg": [-60, 60]}],
    "mask": [{"shape": "cone", "axis": [-1.0, 0.0, -0.5], "half_angle_deg": 25}],
}
LEFT = {"weight": [{"shape": "cone", "axis": [0.3, 0.8, 0.4], "half_angle_deg": 20}]}


def case(regions, angles, sensor="UTM-30LX", period_s=18.0, **density):
    task = Task.model_validate(
        {
            "name": "t",
            "sensor": sensor,
            "servo": "MX-64R",
            "motion": {"period_s": period_s},
            "angles": {"holes": "allow"} | angles,
            "density": density,
        }
        | regions
    )
    return problem_of(LoadedTask(task, Path(), load_catalogue(), ())), task.angles


CASES = {
    "all four free": case(AHEAD, {"step_deg": 45}),
    "all four free, two seconds": case(LEFT, {"step_deg": 45}, period_s=2.0),
    "a fan without symmetry": case(LEFT, {"step_deg": 45}, sensor="URG-04LX", period_s=4.0),
    "a fan without symmetry, axis fixed": case(
        LEFT, {"step_deg": 15, "alpha_rot_deg": 20, "beta_rot_deg": -35}, sensor="URG-04LX", period_s=4.0
    ),
    "scan plane fixed": case(AHEAD, {"step_deg": 15, "alpha_laser_deg": 37, "beta_laser_deg": -12}, period_s=2.0),
    "one angle fixed, one range short": case(
        AHEAD, {"step_deg": 30, "alpha_rot_deg": 100, "beta_laser_deg": [-17, 50]}, period_s=2.0
    ),
    "the paper's sum": case(AHEAD, {"step_deg": 45, "alpha_rot_deg": [0, 90]}, quadrature="equal_angle"),
}


def every_setting(ranges):
    return np.array(list(product(*(ranges.grid_deg(name) for name in NAMES))))


@pytest.mark.parametrize("name", CASES)
def test_no_setting_of_the_whole_grid_is_better_and_the_best_is_found(name, monkeypatch):
    """Brute force: J of every setting, no folding, no bound. Without refinement both must find the same best J."""
    monkeypatch.setattr(families, "REFINE_ROUNDS", ())
    problem, ranges = CASES[name]
    settings = every_setting(ranges)
    found = search(problem, ranges)
    assert found.covered == len(settings)
    assert found.evaluated <= 2 * len(settings)
    J = np.array([quick_J(problem, setting, 486) for setting in np.radians(settings)])
    leaders = [score(problem, np.radians(settings[i])) for i in np.argsort(J)[:15]]
    best = min(leaders, key=lambda s: s.J)
    assert pytest.approx(best.J, abs=best.J_error + found.best[0].score.J_error) == found.best[0].score.J
    assert any(np.allclose(found.best[0].angles_deg, setting, atol=1e-9) for setting in settings)
    for family in found.best:
        again = score(problem, family.angles_rad)
        assert again == family.score

    # the table of scan planes: lowest J over all axes; a bound where it cannot win, right within MARGIN where it can
    by_plane = J.reshape(-1, len(found.planes)).min(axis=0)
    np.testing.assert_array_equal(found.planes[:, :2], settings[: len(found.planes), 2:])
    assert (found.planes[:, 2] - by_plane).max() <= coarse.MARGIN
    winner = np.argmin(by_plane)
    assert found.planes[winner, 2] == pytest.approx(by_plane[winner], abs=coarse.MARGIN)
    named = np.radians(found.planes[winner, [3, 4, 0, 1]])
    assert pytest.approx(by_plane[winner], abs=coarse.MARGIN) == score(problem, named).J


@pytest.mark.parametrize("sensor", ["UTM-30LX", "URG-04LX"])
def test_the_members_of_a_family_are_as_many_as_the_settings_of_its_J(sensor, monkeypatch):
    """Every direction has a weight here and none like its mirror image, so nothing but symmetry makes J equal."""
    monkeypatch.setattr(families, "REFINE_ROUNDS", ())
    uneven = {"weight": [{"shape": "all", "value": 0.2}, LEFT["weight"][0]]}
    problem, ranges = case(uneven, {"step_deg": 45}, sensor=sensor, period_s=4.0)
    best = search(problem, ranges).best
    J = np.array([quick_J(problem, setting, 486) for setting in np.radians(every_setting(ranges))])
    for family in best[:3]:
        assert family.members == (np.abs(J - quick_J(problem, family.angles_rad, 486)) < 1e-7).sum()


@pytest.mark.parametrize("ball_radius_deg", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("period_s", [2.0, 18.0])
def test_the_coarse_J_of_the_search_is_no_further_off_than_its_margin(ball_radius_deg, period_s):
    """`MARGIN` decides which scan planes are never looked at: small balls and fast turns included."""
    problem, ranges = case(AHEAD, {"step_deg": 30}, period_s=period_s, ball_radius_deg=ball_radius_deg)
    planes = search(problem, ranges).planes
    lowest = planes[planes[:, 2] <= planes[:, 2].min() + coarse.MARGIN][:40]  # all of them exact and no bound
    off = [row[2] - score(problem, np.radians(row[[3, 4, 0, 1]])).J for row in lowest]
    assert np.abs(off).max() <= coarse.MARGIN


def test_where_every_direction_counts_the_same_any_axis_is_as_good():
    problem, ranges = case({"weight": [{"shape": "all"}]}, {"step_deg": 30}, period_s=2.0)
    found = search(problem, ranges)
    assert {family.word for family in found.best} == {"any axis"}
    J = [family.score.J for family in found.best]
    assert sorted(J) == J
    assert np.diff(J).min() > 1e-5, "one family per J"
    axes = len(ranges.grid_deg("alpha_rot")) * len(ranges.grid_deg("beta_rot"))
    assert all(family.members % axes == 0 for family in found.best)
    assert all(family.angles_deg[:2] == (0, 0) for family in found.best), "the axis that builds best is upright"


def test_angles_that_the_task_fixes_stay_through_the_refinement():
    fixed = {"alpha_rot_deg": 33.3, "beta_laser_deg": -12.34}
    problem, ranges = case(AHEAD, fixed | {"alpha_laser_deg": [20, 50], "step_deg": 10}, period_s=2.0)
    found = search(problem, ranges)
    for family in found.best:
        alpha_rot, _, alpha_laser, beta_laser = family.angles_deg
        assert (alpha_rot, beta_laser) == (33.3, -12.34)
        assert 20 <= alpha_laser <= 50
        assert np.allclose(np.array(family.angles_deg) * 100, np.round(np.array(family.angles_deg) * 100))
    told = [entry for entry in found.left_out if "fixes" in entry.why]
    assert [(entry.what, entry.saved) for entry in told] == [("search over alpha_rot_deg, beta_laser_deg", 2)]


def test_refinement_never_makes_it_worse(monkeypatch):
    problem, ranges = CASES["one angle fixed, one range short"]
    refined = search(problem, ranges).best[0].score
    monkeypatch.setattr(families, "REFINE_ROUNDS", ())
    plain = search(problem, ranges).best[0].score
    assert refined.J <= plain.J
    assert refined.J < plain.J - 1e-3, "at 30 deg there is something to gain"


def test_all_is_covered_with_fewer_evaluations():
    problem, ranges = case(AHEAD, {"step_deg": 15})
    found = search(problem, ranges)
    assert found.covered == 25 * 13 * 13 * 13
    assert found.evaluated < found.covered / 3
    saved = {entry.what: entry.saved for entry in found.left_out}
    assert saved["equivalent settings"] == found.covered - found.evaluated


@pytest.mark.parametrize("cores", [1, 3, 7])
def test_the_number_of_threads_changes_no_digit(cores, monkeypatch):
    problem, ranges = CASES["all four free, two seconds"]
    before = search(problem, ranges)
    monkeypatch.setattr(parallel.os, "cpu_count", lambda: cores)
    after = search(problem, ranges)
    assert after.best == before.best
    np.testing.assert_array_equal(after.planes, before.planes)
    assert (after.covered, after.evaluated, after.left_out) == (before.covered, before.evaluated, before.left_out)


@pytest.mark.parametrize("name", shipped_tasks())
def test_no_random_setting_beats_the_search_of_a_shipped_task(name):
    """With 1200 draws, 300 where each sums over a sweep: all roughly, the best 20 with all nodes."""
    loaded = load_task(Path(name))
    problem, ranges = problem_of(loaded), loaded.task.angles
    found = search(problem, ranges)
    if name == "ground_ahead":
        assert found.covered == 3_697_669 == 73 * 37 * 37 * 37
    best = found.best[0].score
    low, high = np.array([ranges.limits(angle) for angle in NAMES]).T
    drawn = np.radians(np.random.default_rng(11).uniform(low, high, (1200 if problem.sweep is None else 300, 4)))
    drawn = np.unique(drawn, axis=0)
    rough = [quick_J(problem, setting, 243) for setting in drawn]
    least = found.least_blind
    for i in np.argsort(rough)[:20]:
        other = score(problem, drawn[i])
        if other.blind_weight > 0 and least is None:  # it has a hole, and others have none
            continue
        assert other.J + other.J_error >= best.J - best.J_error, np.degrees(drawn[i])


def test_the_families_shown_are_different_answers():
    """None is the axis of a better one with its J, and none is worse than one behind it."""
    problem, ranges = case(AHEAD, {"step_deg": 15}, period_s=2.0)
    best = search(problem, ranges).best
    assert len(best) == 10
    assert [f.score.J for f in best] == sorted(f.score.J for f in best)
    axes = np.array([R_world_rot(*family.angles_rad[:2])[:, 2] for family in best])
    for i, j in zip(*np.triu_indices(len(best), 1), strict=True):
        same_axis = abs(axes[i] @ axes[j]) > np.cos(np.radians(5))
        assert not (same_axis and abs(best[i].score.J - best[j].score.J) < 1e-4)

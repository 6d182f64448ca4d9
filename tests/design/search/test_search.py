"""The folded search against an unfolded loop over every setting; `benchmarks/design/claims.py` draws settings too."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from quick_tests import samples

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.concurrency import parallel
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import quick_J, score
from scanwright.design.search import coarse, families
from scanwright.design.search.search import search, with_starts
from scanwright.design.task.angle_ranges import NAMES
from scanwright.design.task.task import Limits, LoadedTask, Task, load_task

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
    "a fan all around": case(LEFT, {"step_deg": 45}, sensor="LD19", period_s=4.0),
    "scan plane fixed": case(AHEAD, {"step_deg": 15, "alpha_laser_deg": 37, "beta_laser_deg": -12}, period_s=2.0),
    "one angle fixed, one range short": case(
        AHEAD, {"step_deg": 30, "alpha_rot_deg": 100, "beta_laser_deg": [-17, 50]}, period_s=2.0
    ),
    "the paper's sum": case(
        AHEAD, {"step_deg": 45, "alpha_rot_deg": [0, 90]}, quadrature="equal_angle", grid_step_deg=3
    ),
}


@pytest.fixture
def unrefined(monkeypatch):
    """The answer of the grid."""
    monkeypatch.setattr(families, "MOST_RUNS", (0, 0, 0))


def every_setting(ranges):
    return np.array(list(product(*(ranges.grid_deg(name) for name in NAMES))))


@pytest.mark.usefixtures("unrefined")
@pytest.mark.parametrize("name", samples(CASES, CASES.keys() - {"all four free", "a fan without symmetry"}))
def test_no_setting_of_the_whole_grid_is_better_and_the_best_is_found(name):
    """Brute force: J of every setting, no folding, no bound. Without refinement both must find the same best J."""
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


@pytest.mark.usefixtures("unrefined")
@pytest.mark.parametrize("sensor", ["UTM-30LX", "LD19"])
def test_the_members_of_a_family_are_as_many_as_the_settings_of_its_J(sensor):
    """Every direction has a weight here and none like its mirror image, so nothing but symmetry makes J equal."""
    uneven = {"weight": [{"shape": "all", "value": 0.2}, LEFT["weight"][0]]}
    problem, ranges = case(uneven, {"step_deg": 45}, sensor=sensor, period_s=4.0)
    best = search(problem, ranges).best
    J = np.array([quick_J(problem, setting, 81) for setting in np.radians(every_setting(ranges))])
    for family in best[:3]:
        assert family.members == (np.abs(J - quick_J(problem, family.angles_rad, 81)) < 1e-7).sum()


@pytest.mark.usefixtures("unrefined")
@pytest.mark.parametrize(("ball_radius_deg", "period_s"), [(0.25, 2.0), (0.25, 18.0), (1.0, 2.0)])
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
    assert (np.diff(J) > 1e-5).all(), "one family per J"
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


def found_with(cores, case):
    """A search with three families on so many cores."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(families, "FAMILIES", 3)
        patch.setattr(parallel, "cores", lambda: cores)
        return search(*case)


@pytest.fixture(scope="module")
def refined():
    return found_with(1, CASES["one angle fixed, one range short"])


@pytest.mark.usefixtures("unrefined")
def test_refinement_never_makes_it_worse(refined):
    best, plain = refined.best[0].score, search(*CASES["one angle fixed, one range short"]).best[0].score
    assert best.J <= plain.J
    assert best.J < plain.J - 1e-3, "at 30 deg there is something to gain"


@pytest.mark.usefixtures("unrefined")
def test_a_start_that_is_better_replaces_the_result_and_a_worse_one_does_not():
    problem, ranges = CASES["a fan without symmetry, axis fixed"]
    full = search(problem, ranges)
    best = full.best[0]
    without_best = replace(full, best=full.best[1:])
    assert with_starts(problem, ranges, Limits(), without_best, [full.best[2].angles_deg]) is without_best
    improved = with_starts(problem, ranges, Limits(), without_best, [full.best[2].angles_deg, best.angles_deg])
    assert improved.best[0].score.J == pytest.approx(best.score.J, abs=1e-5)
    assert {family.angles_deg for family in improved.best[1:]} <= {family.angles_deg for family in without_best.best}
    assert [family.score.J for family in improved.best] == sorted(family.score.J for family in improved.best)
    dense = Limits(min_density=best.score.least + 1)  # which the start does not have
    assert with_starts(problem, ranges, dense, without_best, [best.angles_deg]) is without_best


def test_all_is_covered_with_fewer_evaluations():
    problem, ranges = case(AHEAD, {"step_deg": 15})
    found = search(problem, ranges)
    assert found.covered == 25 * 13 * 13 * 13
    assert found.evaluated < found.covered / 3
    saved = {entry.what: entry.saved for entry in found.left_out}
    assert saved["equivalent settings"] == found.covered - found.evaluated


def test_the_number_of_threads_changes_no_digit(refined):
    one, other = refined, found_with(3, CASES["one angle fixed, one range short"])
    assert other.best == one.best and len(one.best) == 3
    np.testing.assert_array_equal(other.planes, one.planes)
    assert (other.covered, other.evaluated, other.left_out) == (one.covered, one.evaluated, one.left_out)


def test_the_shipped_grid_is_as_large_as_told():
    ranges = load_task(Path("ground_ahead")).task.angles
    assert np.prod([len(ranges.grid_deg(name)) for name in NAMES]) == 3_697_669 == 73 * 37 * 37 * 37


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

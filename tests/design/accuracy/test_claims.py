"""What the program states of its answers, in small: `benchmarks/design/claims.py` is the full version.

Stated errors against an independent reference, optima against other searches, and skipped work against work done.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from quick_tests import samples

from benchmarks.design.claims import random_claim
from benchmarks.design.contests import contest
from benchmarks.design.random_tasks import FIELDS, OBJECTIVES, QUADRATURES, random_task
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.objective import score as scoring
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.progress import no_progress
from scanwright.design.search.coarse import Effort, coarse_landscape
from scanwright.design.search.grid_classes import fold_axes, fold_planes, mirrors_of, unfolded
from scanwright.design.search.optimum import directions_left_out
from scanwright.design.search.search import search
from scanwright.design.search.space import SearchSpace
from scanwright.design.sphere import polar_rule
from scanwright.design.sphere.directions import Samples, spiral
from scanwright.design.sphere.polar_rule import breaks_of
from scanwright.design.task.task import Limits, LoadedTask, Task, load_task

BAND = {"shape": "band", "theta_deg": [95, 150], "phi_deg": [-60, 60]}
EXACT = Effort(margin=np.inf, rounds=0)  # so that no bound stands for a J
CONE = {"shape": "cone", "axis": [0.5, 0.2, -0.6], "half_angle_deg": 25}
FAST = {"motion": {"period_s": 2.0}}
SWEEP = {
    "sensor": "URG-04LX",
    "servo": "AX-12A",
    "motion": {"mode": "sweep", "limits_deg": [-90, 90], "period_s": 6.0, "accel_deg_s2": 400.0},
    "density": {"tolerance": 0.01},
}
SETTINGS = np.radians([[0, 0, -50, 35], [0, 90, 0, -90], [100, -40, 30, 60]])


def case(changes, angles=None):
    table = {"name": "t", "sensor": "UTM-30LX", "servo": "MX-64R", "slip_ring": "UH1256-02-0610-06S"} | FAST | changes
    task = Task.model_validate(table | {"angles": angles or {}})
    problem = problem_of(LoadedTask(task, Path(), load_catalogue(), ()))
    if problem.sweep is not None:  # every direction of a sweep costs: fewer beams
        problem = problem.with_beams(problem.bearings_rad[::4], problem.lines, problem.sweep)
    return problem, task.angles


CLAIMS = range(24)


def drawn_claim(number):
    """The field of a claim, and what it is drawn from."""
    return list(FIELDS)[number % len(FIELDS)], np.random.default_rng([11, number])


@pytest.mark.parametrize("number", samples(CLAIMS, CLAIMS[: len(FIELDS)]))
def test_a_stated_error_holds(number, tmp_path):
    """Random tasks, loaded from files, against counted beams: what the count itself may be off by is taken off."""
    field, rng = drawn_claim(number)
    claim = random_claim(rng, tmp_path, field, small=True, most_work=3e4)
    assert claim.kept, claim.words()


def test_the_claims_are_of_all_kinds(tmp_path):
    """Every shape, mask, objective, quadrature and motion is among them, and fans with a gap."""
    drawn = []
    for number in CLAIMS:
        field, rng = drawn_claim(number)
        drawn.append(random_task(rng, tmp_path, field, small=True))
    masks = {f"mask of {shape}" for shape in ("band", "cone", "map", "mesh")}
    motions = {"spin", "sweep", "stop_and_go"}
    assert {*FIELDS, *OBJECTIVES, *QUADRATURES, *motions, *masks} <= {kind for task in drawn for kind in task.kinds}
    assert any(not task.beams.all() for task in drawn)


def test_the_judge_sees_what_the_ray_caster_sees(tmp_path):
    """Boxes in closed form against the mesh that is written of them: the same cells are hit, at the same range."""
    for number in range(4):
        drawn = random_task(np.random.default_rng([3, number]), tmp_path, "scene", small=True)
        cast, own = drawn.loaded.surface, drawn.own_tables().surface
        assert (np.isfinite(cast.range_m) == np.isfinite(own.range_m)).mean() > 0.999
        both = np.isfinite(cast.range_m) & np.isfinite(own.range_m)
        assert (np.abs(cast.range_m - own.range_m)[both] < 1e-4).mean() > 0.999


def test_neither_chance_nor_evolution_beats_the_search():
    """One shipped task with few draws; the command draws hundred thousand for each of them."""
    loaded = load_task(Path("ceiling"))
    result = contest(problem_of(loaded), loaded.task.angles, draws=150, generations=8, seed=3)
    assert len(result.rivals) == 2
    assert result.beaten_by <= 0, result
    assert result.once
    evolved = result.rivals[max(result.rivals, key=lambda name: name.startswith("differential"))][1]
    assert evolved.J < result.best.score.J + 0.01, "evolution found nothing: a rival that cannot win proves nothing"


@pytest.mark.parametrize("sensor", ["UTM-30LX", "URG-04LX"])
def test_equivalent_settings_folded_and_not(sensor):
    """Every grid setting a class of its own, against the folded grid: the same lowest J for each plane and axis."""
    uneven = {"weight": [{"shape": "all", "value": 0.2}, CONE], "sensor": sensor}
    # no beam is just a ball from an axis: rounding would decide whether it is in
    problem, ranges = case(uneven | {"density": {"ball_radius_deg": 2.3}}, {"step_deg": 45})
    folded = fold_axes(ranges), fold_planes(ranges, mirrors_of(problem.bearings_rad))
    whole = unfolded(ranges)
    assert len(folded[0].first) * len(folded[1].first) < 0.3 * len(whole[0].first) * len(whole[1].first)
    lowest = []
    for axes, planes in (folded, whole):
        space = SearchSpace(problem, ranges, Limits(), avoid_holes=False)
        vars(space).update(planes=planes, axes=axes)
        land, _ = coarse_landscape(space, no_progress, EXACT)
        by_plane = land.plain.by_plane[planes.flip.astype(int), planes.classes]
        lowest.append((by_plane, land.plain.by_axis[axes.flip.astype(int), axes.classes]))
    for of_folded, of_whole in zip(*lowest, strict=True):
        np.testing.assert_allclose(of_folded, of_whole, atol=1e-5)


@pytest.mark.parametrize("motion", [{}, SWEEP], ids=["spin", "sweep"])
def test_densities_bounded_and_computed(motion):
    problem, ranges = case({"weight": [BAND]} | motion, {"step_deg": 45, "alpha_rot_deg": 0, "beta_rot_deg": [0, 45]})
    bounded = search(problem, ranges, effort=Effort(rounds=0))
    computed = search(problem, ranges, effort=EXACT)
    told = {entry.what: entry for entry in bounded.left_out}
    assert told["exact densities"].saved > 0
    assert "exact densities" not in {entry.what for entry in computed.left_out}
    assert bounded.best[0] == computed.best[0]
    assert (bounded.planes[:, 2] <= computed.planes[:, 2] + 1e-5).all(), "a bound is a lower bound"


def test_an_angle_that_is_fixed_and_the_same_angle_searched():
    fixed, ranges = case({"weight": [BAND]}, {"step_deg": 30, "alpha_rot_deg": 0, "beta_laser_deg": -60})
    _, free_ranges = case({"weight": [BAND]}, {"step_deg": 30, "alpha_rot_deg": 0})
    one, all_of_them = (search(fixed, these, effort=EXACT) for these in (ranges, free_ranges))
    at = all_of_them.planes[:, 1] == -60
    assert {e.what: e.saved for e in one.left_out}["search over alpha_rot_deg, beta_laser_deg"] == 2
    np.testing.assert_array_equal(one.planes[:, :2], all_of_them.planes[at, :2])
    np.testing.assert_allclose(one.planes[:, 2], all_of_them.planes[at][:, 2], atol=1e-4)


def every_segment(field, axis, more_rad):
    breaks = breaks_of(field, axis, more_rad)
    return np.array(list(pairwise(breaks)))


def every_direction(field, _, wanted, count):
    sets = [spiral(4 * wanted + 17 * index, turn_rad=float(index)) for index in range(count)]
    return tuple(Samples(d, field.weight_at(d) * (4 * np.pi / len(d))) for d in sets)


@pytest.mark.parametrize("motion", [{}, SWEEP], ids=["spin", "sweep"])
def test_directions_of_weight_zero_looked_at_and_not(motion, monkeypatch):
    problem, _ = case({"weight": [BAND]} | motion)
    assert [entry.what for entry in directions_left_out(problem)] == ["directions of weight zero"]
    skipped = [score(problem, setting) for setting in SETTINGS]
    monkeypatch.setattr(polar_rule, "weighted_segments", every_segment)
    monkeypatch.setattr(scoring, "sample_sets", every_direction)
    looked_at = [score(problem, setting) for setting in SETTINGS]
    for one, other in zip(skipped, looked_at, strict=True):
        assert one.J != other.J, "another sum"
        assert abs(one.J - other.J) <= one.J_error + other.J_error


@pytest.mark.parametrize("motion", [{}, SWEEP], ids=["spin", "sweep"])
def test_masked_directions_left_out_or_looked_at_with_weight_zero(motion, monkeypatch):
    masked, _ = case({"weight": [BAND], "mask": [CONE]} | motion)
    painted, _ = case({"weight": [BAND, CONE | {"value": 0.0}]} | motion)
    told = {entry.what for entry in directions_left_out(masked)}
    assert told == {"masked directions", "directions of weight zero"}
    left_out = [score(masked, setting) for setting in SETTINGS]
    monkeypatch.setattr(polar_rule, "weighted_segments", every_segment)
    monkeypatch.setattr(scoring, "sample_sets", every_direction)
    for one, setting in zip(left_out, SETTINGS, strict=True):
        other = score(painted, setting)
        assert abs(one.J - other.J) <= one.J_error + other.J_error

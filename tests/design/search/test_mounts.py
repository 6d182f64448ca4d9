"""Reference mounts, the gain over them, and the preference for a simple mount."""

from dataclasses import replace

import numpy as np
import pytest

from scanwright.design.errors import TaskError
from scanwright.design.objective.holes import NO_BLIND_WEIGHT
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.progress import no_progress
from scanwright.design.search.families import Family
from scanwright.design.search.mounts.gain import EASIER, gain_lines, gains
from scanwright.design.search.mounts.reference import angles_used, reference_mounts
from scanwright.design.search.mounts.simplest import simplest_first
from scanwright.design.search.optimum import find_optimum
from scanwright.design.search.space import SearchSpace
from scanwright.design.task.angle_ranges import NAMES
from scanwright.design.task.task import Limits, load_task

BAND = {"shape": "band", "theta_deg": [60, 130]}
BASE = {
    "name": "t",
    "sensor": "URG-04LX",
    "servo": "MX-64R",
    "slip_ring": "UH1256-02-0610-06S",
    "motion": {"period_s": 6.0},
    "density": {"ball_radius_deg": 4.0, "tolerance": 1e-3},
    "angles": {"step_deg": 30.0},
    "weight": [BAND],
}
SWEEP = {"mode": "sweep", "limits_deg": [-90, 90], "period_s": 12.0, "accel_deg_s2": 200.0}
EASY = {"sensor": "URG-04LX", "servo": "AX-12A", "slip_ring": None, "motion": SWEEP}


def task(**keys):
    told = BASE | keys
    return load_task({key: value for key, value in told.items() if value is not None})


def random_task(rng, **angles):
    theta = np.sort(rng.uniform(0, 180, 2)) + np.array([0, 5])
    phi = rng.uniform(-180, 180) + np.array([0, rng.uniform(30, 360)])
    band = {"shape": "band", "theta_deg": theta.clip(0, 180).tolist(), "phi_deg": phi.tolist()}
    return task(weight=[band], angles={"step_deg": 30.0} | angles)


def mounts_of(loaded):
    problem = problem_of(loaded)
    return problem, reference_mounts(problem, loaded.task)


@pytest.mark.parametrize("keys", [{}, EASY | {"density": BASE["density"] | {"tolerance": 0.1}}], ids=["spin", "sweep"])
def test_each_mount_has_the_j_of_its_angles_and_the_first_factor_is_the_smallest(keys):
    problem, mounts = mounts_of(task(**keys))
    assert [mount.name for mount in mounts] == ["rolling", "pitching", "upright, one tilt", "Bonn, 45 deg"]
    for mount in mounts:
        assert mount.score.J == pytest.approx(score(problem, mount.angles_rad).J, abs=1e-9)
    found = gains(problem, (0, 10, 20, 30), -3.0, mounts)
    factors = [gain.factor for gain in found]
    assert factors == sorted(factors)
    assert factors[0] == pytest.approx(np.exp(min(mount.score.J for mount in mounts) + 3))
    assert gain_lines(found)[1].startswith(f"  {factors[0]:.2f} x")


def test_no_setting_of_a_mount_that_keeps_what_the_task_asks_is_better_than_the_tuned_one():
    loaded = task(limits={"max_blind_cone_deg": 60.0})
    problem, mounts = mounts_of(loaded)
    required = SearchSpace(problem, loaded.task.angles, loaded.task.limits, avoid_holes=True)
    *_, upright, bonn = mounts
    tilts = [(0, 0, tilt, 0) for tilt in range(-90, 91, 6)] + [(0, 0, 0, tilt) for tilt in range(-90, 91, 6)]
    twists = [(180, 45, 90, twist) for twist in range(-90, -44, 5)]
    for mount, settings in ((upright, tilts), (bonn, twists)):
        J = [required.J(np.array(setting, dtype=float), 2187) for setting in settings]
        assert np.isfinite(J).any() and mount.keeps_limits
        assert mount.score.J <= min(J) + 3e-3


def test_a_mount_that_no_angle_frees_of_holes_is_flagged():
    problem, mounts = mounts_of(task(weight=[{"shape": "all"}]))
    found = {gain.mount.name: gain for gain in gains(problem, (0, 10, 20, 30), -3.0, mounts)}
    assert mounts[0].score.blind_weight > 0.05 and "blind to" in found["rolling"].words()


def test_an_answer_that_is_not_better_is_told_so():
    problem, mounts = mounts_of(task())
    best = min(mounts, key=lambda mount: mount.score.J)
    words = [
        gain_lines(gains(problem, *of, mounts))[-1]
        for of in (((9, 9, 9, 9), best.score.J - 0.01), (best.angles_deg, best.score.J))
    ]
    assert words[0].endswith(f"is as good within 2%{EASIER}")
    assert words[1] == f"the optimum is itself a simple mount: {best.name}"
    far = gain_lines(gains(problem, (9, 9, 9, 9), best.score.J - 0.1, mounts))
    assert far[-1].startswith("  "), "nothing is stated of a mount that loses a tenth"


def test_a_mount_that_the_task_excludes_is_told_as_such():
    problem, mounts = mounts_of(task(angles={"alpha_rot_deg": 45, "beta_rot_deg": 0}))
    assert not any(mount.in_ranges for mount in mounts)
    best = min(mount.score.J for mount in mounts)
    assert gain_lines(gains(problem, (45, 0, 1, 1), best, mounts))[-1].endswith("but the angles of the task exclude it")
    _, hanging = mounts_of(task(angles={"alpha_rot_deg": 180, "beta_rot_deg": 0}))
    assert hanging[2].in_ranges and hanging[2].angles_deg[:2] == (180, 0), "turned over it is the same"


def test_other_objectives_have_differences_of_j():
    problem, mounts = mounts_of(task(density={"ball_radius_deg": 4.0, "objective": "homogeneity"}))
    found = gains(problem, (0, 0, 0, 0), 0.0, mounts)
    assert all(gain.factor is None for gain in found)
    assert [gain.J_less for gain in found] == sorted(mount.score.J for mount in mounts)
    heading, best, *_ = gain_lines(found)
    assert heading.startswith("J, against simple mounts")
    assert best.startswith(f"  {found[0].J_less:+.4f} in J ")


def families_of(rng, loaded, problem):
    """Some settings of a task, the lowest J first, as a search has them."""
    limits = [loaded.task.angles.limits(name) for name in NAMES]
    settings = [tuple(float(rng.uniform(*each)) for each in limits) for _ in range(4)]
    found = [Family(setting, score(problem, np.radians(setting)), 1, "") for setting in settings]
    return tuple(sorted(found, key=lambda family: family.score.J))


@pytest.mark.parametrize("seed", range(10))
def test_the_simplest_mount_costs_no_more_than_accepted_and_breaks_nothing(seed):
    rng = np.random.default_rng(seed)
    loss = float(rng.choice([0.0, 0.05, 0.3, 0.8]))
    loaded = random_task(rng, prefer="simple", prefer_loss=loss)
    problem, ranges = problem_of(loaded), loaded.task.angles
    limits = Limits(max_blind_cone_deg=float(rng.uniform(40, 90)))
    lowest, *_ = families = families_of(rng, loaded, problem)
    free = lowest.score.blind_weight <= NO_BLIND_WEIGHT
    required = SearchSpace(problem, ranges, limits, avoid_holes=False)
    answer, *rest = simplest_first(required, families)
    assert answer.score.J == score(problem, answer.angles_rad).J and ranges.hold(answer.angles_deg)
    assert np.exp(lowest.score.J - answer.score.J) >= 1 - loss - 1e-6
    same = {family.angles_deg for family in families} - {answer.angles_deg}
    assert {family.angles_deg for family in rest} == same
    if answer.angles_deg != lowest.angles_deg:
        assert replace(required, avoid_holes=free).keeps(answer.score, np.array(answer.angles_deg))
        assert angles_used(answer.angles_deg) <= angles_used(lowest.angles_deg)
    if loss == 0.8 and limits.max_blind_cone_deg > 60:
        assert angles_used(answer.angles_deg) < 4, "something simpler is within four fifths"


def test_a_mount_with_one_angle_is_taken_if_it_costs_little_and_the_answer_says_so():
    flat = {"alpha_rot_deg": 0, "beta_rot_deg": 0, "step_deg": 30.0, "prefer": "simple"}
    found = find_optimum(task(angles=flat | {"prefer_loss": 0.6}), no_progress)
    answer, lowest = found.search.best[0], found.search.lowest
    assert angles_used(answer.angles_deg) < angles_used(lowest.angles_deg)
    assert found.angle_set().J == pytest.approx(answer.score.J, abs=1e-3)
    told, cost = found.preferred_lines()
    assert [line.endswith(" [preferred]") for line in found.table()[2:4]] == [True, False]
    assert told.startswith("preferred as the simplest mount that costs at most 60.0% of the beams per ball: (")
    assert cost.startswith(f"it costs {100 * -np.expm1(lowest.score.J - answer.score.J):.1f}%")
    assert set(found.preferred_lines()) < set(found.lines())
    facts = found.facts()["preferred"]
    assert facts["J_more"] == answer.score.J - lowest.score.J and facts["accepted_loss"] == 0.6
    assert [gain["factor"] for gain in found.facts()["gains"]] == [gain.factor for gain in found.gains]


def test_the_preference_holds_for_the_shortest_period():
    asked = task(
        motion={"period_s": "shortest"},
        limits={"max_line_gap_deg": 6.0},
        angles={"alpha_rot_deg": 0, "beta_rot_deg": 0, "step_deg": 45.0, "prefer": "simple", "prefer_loss": 0.6},
    )
    found = find_optimum(asked, no_progress)
    assert found.search.lowest is not None and found.loaded.task.motion.period_s < 60
    answer, lowest = found.search.best[0].score.J, found.search.lowest.score.J
    assert np.exp(lowest - answer) >= 0.4 and found.search.best[0].score.blind_weight <= NO_BLIND_WEIGHT


@pytest.mark.parametrize(
    ("angles", "told"),
    [
        ({"prefer": "easy"}, "angles.prefer = 'easy'"),
        ({"prefer": "simple", "prefer_loss": 1.0}, "angles.prefer_loss = 1.0"),
        ({"prefer_loss": 0.1}, "prefer_loss = 0.1 is for prefer = 'simple'"),
    ],
)
def test_a_wrong_preference_is_one_line(angles, told):
    with pytest.raises(TaskError) as error:
        task(angles=angles)
    assert told in str(error.value) and len(str(error.value).splitlines()) == 1


def test_the_preference_is_part_of_the_digest():
    one, other = task(), task(angles={"step_deg": 30.0, "prefer": "simple"})
    assert one.sha256() != other.sha256()
    same = replace(other, task=other.task.model_copy(update={"angles": one.task.angles}))
    assert same.sha256() == one.sha256()

"""The optimum with what parts hide: J against ball searches on masked scans, and a workshop made of thin air."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.density.beams import beam_directions_rot, scan_at
from scanwright.design.density.spin import ball_search
from scanwright.design.errors import BuildError
from scanwright.design.objective.ball_search import start_phases
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.progress import no_progress
from scanwright.design.search.families import Family
from scanwright.design.search.with_parts import Refused, choose_with_parts, equivalents, score_with
from scanwright.design.self_occlusion import AXIS_STEPS, SelfOcclusion
from scanwright.design.sphere.directions import weighted_samples
from scanwright.design.task.angle_ranges import AngleRanges
from scanwright.design.task.task import Limits, LoadedTask, Task

AHEAD = {"shape": "band", "theta_deg": [60, 130], "phi_deg": [-70, 70]}


def problem(sensor="UTM-30LX", region=AHEAD):
    table = {
        "name": "t",
        "sensor": sensor,
        "servo": "MX-64R",
        "slip_ring": "UH1256-02-0610-06S",
        "motion": {"period_s": 2.0},
        "weight": [region],
    }
    return problem_of(LoadedTask(Task.model_validate(table), Path("t.toml"), load_catalogue(), ()))


def family(p, *angles_deg):
    return Family(angles_deg, score(p, np.radians(angles_deg)), 1, "")


@dataclass(frozen=True)
class ConeRegion:
    """A workshop whose parts fill the cone about -z of the rotation frame, and which refuses some settings."""

    p: object
    half_rad: float
    refuses: tuple = ()

    def bound(self, setting_rad):
        if any(np.allclose(np.degrees(setting_rad), setting) for setting in self.refuses):
            return Refused("tilted too far")
        beams = beam_directions_rot(self.p.bearings_rad, *setting_rad[2:])
        return SelfOcclusion(beams[:, 2] < -np.cos(self.half_rad), None)

    shadow = bound


@pytest.mark.parametrize("still", [False, True])
def test_J_with_hidden_beams_is_that_of_a_ball_search_without_them(still):
    p = problem()
    setting = np.radians([20, 60, 30, -40])
    rng = np.random.default_rng(3)
    beams = np.zeros(len(p.bearings_rad), dtype=bool)
    beams[500:640] = True
    stator = np.zeros((len(beams), AXIS_STEPS), dtype=bool)
    if still:
        stator[100:420, 90:260] = True
        stator[:, rng.integers(0, AXIS_STEPS, 5)] = True
    found = score_with(p, setting, SelfOcclusion(beams, stator))
    assert found.J > score(p, setting).J + 0.02
    samples = weighted_samples(p.field, 4000)
    J = []
    for phase in start_phases(p.lines.count, p.lines.step_rad):
        joint = p.lines.angles_rad + phase
        column = np.rint(np.degrees(joint) / 0.5).astype(int) % AXIS_STEPS
        free = ~(beams[:, None] | stator[:, column]).T.ravel()
        counts = ball_search(scan_at(p.bearings_rad, joint, setting)[free], samples.directions, p.ball_rad)
        J.append(-np.log1p(counts) @ samples.weights / samples.weights.sum())
    assert found.J == pytest.approx(np.mean(J), abs=found.J_error + 0.01)


def test_equivalent_settings_have_the_same_J_and_stay_in_the_ranges():
    p, ranges = problem(), AngleRanges()
    setting = (20.0, 60.0, 30.0, -40.0)
    found = equivalents(p, setting, ranges)
    assert found[0] == setting and len(set(found)) == 4
    J = score(p, np.radians(setting)).J
    for other in found:
        assert score(p, np.radians(other)).J == pytest.approx(J, abs=1e-9)
    assert equivalents(p, setting, AngleRanges(alpha_rot_deg=(0, 90), alpha_laser_deg=(0, 90))) == [setting]
    around = problem("LD19")
    assert len(equivalents(around, setting, ranges)) == 8
    J = [score(around, np.radians(other)).J for other in equivalents(around, setting, ranges)]
    np.testing.assert_allclose(J, J[0], atol=1e-9)
    assert len(equivalents(problem("URG-04LX"), setting, ranges)) == 2  # its fan is not symmetric


def test_the_equivalent_that_hides_least_is_built():
    """A fan that dips towards the servo loses beams; its mirror image looks the other way and loses none."""
    p = problem(region={"shape": "all"})
    towards, away = (0.0, 40.0, 0.0, 45.0), None
    workshop = ConeRegion(p, np.radians(60))
    for setting in equivalents(p, towards, AngleRanges()):
        if not workshop.bound(np.radians(setting)).beams.any():
            away = setting
    assert away is not None and workshop.bound(np.radians(towards)).beams.any()
    chosen = choose_with_parts(p, (family(p, *towards),), AngleRanges(), Limits(), workshop, no_progress)
    assert chosen.family.angles_deg == away
    assert chosen.shadow.share() == 0 and chosen.family.score.J == pytest.approx(chosen.bare.J, abs=1e-9)
    assert chosen.bounded == 2 and chosen.built == 1


@pytest.mark.parametrize(("half_deg", "worse"), [(60, 0), (85, 1)])
def test_a_family_that_hides_less_wins_and_the_rest_is_not_made(half_deg, worse):
    p = problem()
    fixed = AngleRanges(alpha_rot_deg=0, beta_rot_deg=(0, 90), alpha_laser_deg=0, beta_laser_deg=(0, 90))
    families = (family(p, 0.0, 90.0, 0.0, 85.0), family(p, 0.0, 20.0, 0.0, 20.0), family(p, 0.0, 85.0, 0.0, 3.0))
    workshop = ConeRegion(p, np.radians(half_deg))
    chosen = choose_with_parts(p, families, fixed, Limits(), workshop, no_progress)
    best = min(families, key=lambda f: score_with(p, f.angles_rad, workshop.bound(f.angles_rad)).J)
    assert chosen.family.angles_deg == best.angles_deg
    assert chosen.built <= len(families) and chosen.open == 0
    assert chosen.worse == sum(each.score.J < chosen.bare.J for each in families) == worse
    said = f"mounts with a lower J without parts that lose more beams to their parts: {worse}"
    assert (said in chosen.lines()) == bool(worse)


def test_the_simplest_mount_is_built_though_another_one_has_a_lower_J_and_hides_less():
    p = problem()
    families = (family(p, 0.0, 85.0, 0.0, 3.0), family(p, 0.0, 90.0, 0.0, 85.0), family(p, 0.0, 20.0, 0.0, 20.0))
    simple = AngleRanges(prefer="simple", prefer_loss=0.5, holes="allow")
    chosen = choose_with_parts(p, families, simple, Limits(), ConeRegion(p, np.radians(60)), no_progress)
    assert chosen.family.angles_deg == families[0].angles_deg and chosen.built == 1
    refused = tuple(equivalents(p, families[0].angles_deg, simple))
    chosen = choose_with_parts(p, families, simple, Limits(), ConeRegion(p, np.radians(60), refused), no_progress)
    assert chosen.family.angles_deg in equivalents(p, families[1].angles_deg, simple)


def test_what_cannot_be_built_is_refused_with_its_reason():
    p = problem()
    families = (family(p, 0.0, 90.0, 0.0, 85.0), family(p, 0.0, 20.0, 0.0, 20.0))
    fixed = AngleRanges(alpha_rot_deg=0, beta_rot_deg=(0, 90), alpha_laser_deg=0, beta_laser_deg=(0, 90))
    first, second = sorted(families, key=lambda f: f.score.J)
    chosen = choose_with_parts(p, families, fixed, Limits(), ConeRegion(p, 0.1, (first.angles_deg,)), no_progress)
    assert chosen.family.angles_deg == second.angles_deg
    assert [reason for _, reason in chosen.refused] == ["tilted too far"]
    (told,) = chosen.left_out()
    assert (told.what, told.why) == ("1 mount with a lower J", "tilted too far")
    assert "1 mount with a lower J rejected: tilted too far" in chosen.lines()
    with pytest.raises(BuildError, match="tilted too far"):
        choose_with_parts(
            p, families, fixed, Limits(), ConeRegion(p, 0.1, (first.angles_deg, second.angles_deg)), no_progress
        )
    with pytest.raises(BuildError, match=r"limits\.max_blocked"):
        choose_with_parts(p, families[:1], fixed, Limits(max_blocked=0.01), ConeRegion(p, 1.2), no_progress)


def test_a_sweep_keeps_its_setting():
    p = problem("URG-04LX")
    assert equivalents(replace(p, sweep=object()), (1.0, 2.0, 3.0, 4.0), AngleRanges()) == [(1.0, 2.0, 3.0, 4.0)]


def test_a_setting_whose_parts_failed_a_check_is_not_chosen_again():
    p = problem()
    families = (family(p, 0.0, 90.0, 0.0, 85.0), family(p, 0.0, 20.0, 0.0, 20.0))
    fixed = AngleRanges(alpha_rot_deg=0, beta_rot_deg=(0, 90), alpha_laser_deg=0, beta_laser_deg=(0, 90))
    first, second = sorted(families, key=lambda f: f.score.J)
    failed = {first.angles_deg: "the mount bends"}
    chosen = choose_with_parts(p, families, fixed, Limits(), ConeRegion(p, 0.1), no_progress, failed)
    assert chosen.family.angles_deg == second.angles_deg
    assert any("fail a check: the mount bends" in reason for _, reason in chosen.refused)
    with pytest.raises(BuildError, match="the mount bends"):
        choose_with_parts(p, (first,), fixed, Limits(), ConeRegion(p, 0.1), no_progress, failed)

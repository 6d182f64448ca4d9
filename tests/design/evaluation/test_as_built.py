"""What a scanner sees with its parts, against simulated scans without the beams that the parts block."""

import numpy as np
import pytest

from scanwright.design.density.ball_count import ball_count
from scanwright.design.density.beams import scan_at
from scanwright.design.errors import BuildError
from scanwright.design.evaluation.as_built import as_built, seen_of
from scanwright.design.evaluation.coverage import coverage, mean_density_at
from scanwright.design.evaluation.metres import on_planes
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.search.mounts.reference import reference_mounts
from scanwright.design.search.with_parts import score_with
from scanwright.design.self_occlusion import AXIS_STEPS, SelfOcclusion
from scanwright.design.sphere.directions import spiral
from scanwright.design.task.task import load_task

GROUND = {"shape": "ground", "from_m": 0.5, "to_m": 3.0, "width_m": 2.0, "height_m": 0.4}
TASK = {"name": "t", "sensor": "URG-04LX", "servo": "AX-12A", "weight": [{"shape": "all"}]}
SWEEP = {"mode": "sweep", "limits_deg": [-90, 90], "period_s": 12.0, "accel_deg_s2": 200.0}
SPIN = {"period_s": 12.0}
RING = {"servo": "MX-64R", "slip_ring": "UH1256-02-0610-06S"}
DENSITY = {"ball_radius_deg": 4.0, "tolerance": 0.01}
SETTING = np.radians([0.0, 0.0, 0.0, -70.0])
DIRECTIONS = spiral(500)
MOST = 0.8


def task(motion, **keys):
    ring = RING if motion is SPIN else {}
    return load_task(TASK | ring | {"motion": motion, "density": DENSITY} | keys)


def shadow_for(problem):
    """The middle of the fan is blocked by what turns; beside it what stands still blocks most of the turn."""
    off_rad = abs(problem.bearings_rad)
    stator = np.zeros((len(off_rad), AXIS_STEPS), bool)
    stator[off_rad < np.radians(50), : int(MOST * AXIS_STEPS)] = True
    return SelfOcclusion(off_rad < np.radians(25), stator)


@pytest.mark.parametrize("motion", [SPIN, SWEEP], ids=["spin", "sweep"])
def test_density_and_coverage_are_those_of_the_beams_that_leave_the_scanner(motion):
    problem = problem_of(task(motion))
    shadow = shadow_for(problem)
    counted = np.zeros(len(DIRECTIONS))
    for k in range(4):
        joint = problem.lines.angles_rad + k * problem.lines.step_rad / 4
        if problem.sweep is not None:
            joint = problem.sweep.angles_rad((k + 0.5) / 4)
        beams = scan_at(problem.bearings_rad, joint, SETTING)[shadow.free(joint).ravel()]
        counted += ball_count(beams, DIRECTIONS, problem.ball_rad) / 4
    found = mean_density_at(problem, SETTING, DIRECTIONS, shadow)
    assert abs(found - counted).max() < 0.06 * counted.max()
    assert found.sum() == pytest.approx(counted.sum(), rel=0.01)
    blind = coverage(problem, SETTING, shadow).blind_fraction
    assert blind == pytest.approx((counted == 0).mean(), abs=0.02)
    assert blind > coverage(problem, SETTING).blind_fraction + 0.05


@pytest.mark.parametrize("motion", [SPIN, SWEEP], ids=["spin", "sweep"])
def test_the_record_is_of_the_scanner_with_its_parts_and_of_mounts_without(motion):
    loaded = task(motion)
    problem = problem_of(loaded)
    shadow = shadow_for(problem)
    found, bare = (as_built(problem, loaded.task, SETTING, each) for each in (shadow, None))
    judged = score_with(problem, SETTING, shadow)
    assert found.own == seen_of(problem, SETTING, judged, shadow)
    assert found.own.blind_weight == judged.blind_weight > bare.own.blind_weight
    assert found.own.blind_weight == pytest.approx(found.own.blind_fraction, abs=0.02)  # all of the sphere counts
    fan_deg = np.degrees(np.ptp(problem.bearings_rad))
    assert found.blocked == pytest.approx((50 + 50 * MOST) / fan_deg, abs=0.01) and bare.blocked is None
    factors = [mount.factor for mount in found.mounts]
    assert factors == sorted(factors)
    before = {mount.name: mount.factor for mount in bare.mounts}
    worth = np.exp(score(problem, SETTING).J - judged.J)
    for mount in found.mounts:
        assert mount.factor == pytest.approx(worth * before[mount.name])
    again = as_built(problem, loaded.task, SETTING, shadow, judged, reference_mounts(problem, loaded.task))
    assert again == found
    assert all(line.startswith("with parts") for line in found.lines())
    assert all(line.startswith("without parts") for line in bare.lines())
    assert any("blind behind fixed parts" in line for line in found.lines())


def test_points_on_a_plane_are_those_that_no_part_blocks():
    loaded = task(SPIN, weight=[GROUND])
    problem = problem_of(loaded)
    none = SelfOcclusion(np.zeros(len(problem.bearings_rad), bool), None)
    (plain,), (same,) = on_planes(loaded, problem, SETTING), on_planes(loaded, problem, SETTING, none)
    assert plain == same
    half = SelfOcclusion(problem.bearings_rad < 0, None)
    (fewer,) = on_planes(loaded, problem, SETTING, half)
    assert fewer.points < plain.points


def test_a_shadow_of_another_lidar_is_refused():
    problem = problem_of(task(SPIN))
    with pytest.raises(BuildError, match="made for a lidar of 7 beams, the task has"):
        mean_density_at(problem, SETTING, DIRECTIONS, SelfOcclusion(np.zeros(7, bool), None))

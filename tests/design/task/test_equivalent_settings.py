"""Angles beyond their ranges: what stands in for them sees the same, to the pose or to J."""

import numpy as np
import pytest
from pydantic import ValidationError
from quick_tests import samples

from scanwright.design.frames import R_rot_laser, R_world_rot
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.task.angle_ranges import AngleRanges
from scanwright.design.task.equivalent_settings import BOUNDS, equivalents_within
from scanwright.design.task.task import load_task

BEYOND = [(20, 30, 145, 10), (20, 30, -40, 130), (200, 30, 20, 10), (20, -110, 20, 10), (-190, 100, 120, -95)]


def spans(angles):
    return {name: (float(angle), float(angle)) for name, angle in zip(BOUNDS, angles, strict=True)}


def angles_of(found):
    assert all(low == high for low, high in found.setting.values())
    return [low for low, _ in found.setting.values()]


def poses(angles_deg, gamma_rad):
    """Laser in the world at angles of the servo, shape (n, 3, 3)."""
    alpha_rot, beta_rot, alpha_laser, beta_laser = np.radians(angles_deg)
    return R_world_rot(alpha_rot, beta_rot, gamma_rad) @ R_rot_laser(alpha_laser, beta_laser, 0.0)


@pytest.mark.parametrize("angles", BEYOND)
def test_what_is_no_mirror_image_is_the_same_pose_at_the_told_angle_of_the_servo(angles):
    gamma = np.linspace(-3, 3, 7)
    found = [each for each in equivalents_within(spans(angles)) if not each.mirrored]
    assert found
    for each in found:
        turned = each.gamma_sign * gamma + np.radians(each.gamma_added_deg)
        np.testing.assert_allclose(poses(angles_of(each), turned), poses(angles, gamma), atol=1e-12)


@pytest.mark.parametrize("angles", BEYOND)
@pytest.mark.parametrize("sensor", samples(["URG-04LX", "UTM-30LX"], ["URG-04LX"]))
def test_every_equivalent_of_a_servo_that_spins_has_the_same_J(sensor, angles):
    region = {"shape": "cone", "axis": [1, 1, -1], "half_angle_deg": 40}
    table = {
        "name": "t",
        "sensor": sensor,
        "servo": "MX-64R",
        "slip_ring": "UH1256-02-0610-06S",
        "motion": {"mode": "spin", "period_s": 2.03},  # no whole number of lines
        "weight": [region],
    }
    problem = problem_of(load_task(table))
    found = equivalents_within(spans(angles))
    assert any(each.mirrored for each in found)
    J = [score(problem, np.radians(each)).J for each in (angles, *(angles_of(each) for each in found))]
    np.testing.assert_allclose(J, J[0], atol=1e-9)


@pytest.mark.parametrize("name", BOUNDS)
def test_everything_beyond_a_range_has_an_equivalent_within_all_of_them(name):
    for angle in (-350, -200, 95, 181, 300):
        if abs(angle) > BOUNDS[name]:
            assert equivalents_within(spans((10, 20, 30, 40)) | {name: (float(angle), float(angle))})


@pytest.mark.parametrize(
    ("ranges", "words"),
    [
        (
            {"alpha_laser_deg": 145},
            "alpha_laser_deg = 145 is not within -90 .. 90; sees the same as alpha_laser_deg = 35, if the servo "
            "turns all around; in a sweep as alpha_laser_deg = -35 and limits_deg with the other sign",
        ),
        (
            {"alpha_rot_deg": 200},
            "alpha_rot_deg = 200 is not within -180 .. 180; sees the same as alpha_rot_deg = -160",
        ),
        (
            {"alpha_laser_deg": (45, 145)},
            "what lies in [90, 145] sees the same as alpha_laser_deg = [35, 90], if the servo turns all around",
        ),
        ({"alpha_rot_deg": (170, 190)}, "what lies in [180, 190] sees the same as alpha_rot_deg = [-180, -170]"),
        (
            {"alpha_rot_deg": 10, "beta_rot_deg": 100, "alpha_laser_deg": 5, "beta_laser_deg": 0},
            "; sees the same as alpha_rot_deg = -170, beta_rot_deg = 80, if the servo turns all around; in a sweep as "
            "alpha_rot_deg = -170, beta_rot_deg = 80 and limits_deg 180 deg further",
        ),
    ],
)
def test_the_refusal_names_the_equivalent_setting(ranges, words):
    with pytest.raises(ValidationError) as refused:
        AngleRanges(**ranges)
    (fault,) = refused.value.errors()
    assert words in fault["msg"]


def test_a_slip_of_the_keys_gets_no_advice():
    with pytest.raises(ValidationError, match=r"-180 \.\. 180 \["):
        AngleRanges(alpha_rot_deg=1e300)
    with pytest.raises(ValidationError, match="does not rise"):
        AngleRanges(alpha_rot_deg=(5, -5))

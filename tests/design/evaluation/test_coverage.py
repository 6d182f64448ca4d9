"""Blind and masked shares in closed form, and against a ball search on random directions."""

from dataclasses import replace
from math import acos, cos, radians, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.evaluation.coverage import MOST_HIDDEN, coverage, hidden_regions, hidden_share
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.ball_search import scan_tree
from scanwright.design.objective.named_objectives import log
from scanwright.design.objective.problem import problem_of
from scanwright.design.task.task import LoadedTask, Task

CONE = {"shape": "cone", "axis": [-1.0, 0.0, -0.5], "half_angle_deg": 25}


def problem(mask=(), sensor="UTM-30LX", ball_radius_deg=2.0, period_s=18.0):
    task = Task.model_validate(
        {
            "name": "t",
            "sensor": sensor,
            "servo": "MX-64R",
            "motion": {"period_s": period_s},
            "weight": [{"shape": "all"}],
            "mask": mask,
            "density": {"ball_radius_deg": ball_radius_deg},
        }
    )
    return problem_of(LoadedTask(task, Path(), load_catalogue(), ()))


def cap(half_rad):
    """Share of the sphere within an angle of one direction."""
    return (1 - cos(max(half_rad, 0.0))) / 2


@pytest.mark.parametrize("tilt_deg", [0, 10, 45, 62, 80, 87, 89, 90])
@pytest.mark.parametrize("ball_deg", [0.5, 2.0, 20.0])
def test_a_plane_tilted_sideways_leaves_a_cone_at_either_pole(tilt_deg, ball_deg):
    """The beams at +-90 deg rise by the tilt: they come within 90 - tilt of either pole, the ball within less."""
    seen = coverage(problem(ball_radius_deg=ball_deg), np.radians([33, -20, tilt_deg, 0]))
    assert seen.blind_fraction == pytest.approx(2 * cap(radians(90 - tilt_deg - ball_deg)), abs=2e-6)
    assert seen.masked_fraction == 0


@pytest.mark.parametrize("tilt_deg", [-70, -30, 30, 70, 90])
@pytest.mark.parametrize(("sensor", "ends_deg"), [("UTM-30LX", (-135, 135)), ("URG-04LX", (-119.53125, 119.8828125))])
def test_a_plane_tilted_forwards_leaves_more_where_the_fan_has_its_gap(tilt_deg, sensor, ends_deg):
    """cos(polar) = -sin(beta) cos(bearing): the front beam comes nearest to one pole, the last beam to the other."""
    seen = coverage(problem(sensor=sensor), np.radians([-60, 45, 0, tilt_deg]))
    lean = sin(radians(abs(tilt_deg)))
    front = radians(90 - abs(tilt_deg) - 2)
    rear = acos(lean * -min(cos(radians(end)) for end in ends_deg)) - radians(2)
    assert seen.blind_fraction == pytest.approx(cap(front) + cap(rear), abs=2e-6)


@pytest.mark.parametrize("half_deg", [1, 25, 90, 179])
def test_a_cone_hides_its_solid_angle(half_deg):
    seen = coverage(problem([CONE | {"half_angle_deg": half_deg}]), np.radians([0, 90, 0, -90]))
    assert seen.masked_fraction == pytest.approx(cap(radians(half_deg)), abs=2e-6)


def test_a_sphere_that_is_all_masked_is_not_blind():
    plain = problem([])
    everything = plain.with_objective(
        log(replace(plain.field, mask=plain.field.weight))
    )  # no task is read with such a mask
    seen = coverage(everything, np.zeros(4))
    assert (seen.masked_fraction, seen.blind_fraction) == (1.0, 0.0)


def test_masked_directions_leave_the_blind_share():
    """A mask about the axis over one blind cone leaves the other one, of a smaller sphere."""
    setting = np.radians([33, -20, 50, 0])
    mask = CONE | {"axis": R_world_rot(*setting[:2])[:, 2].tolist(), "half_angle_deg": 45}
    seen = coverage(problem([mask]), setting)
    assert seen.blind_fraction == pytest.approx(cap(radians(38)) / (1 - cap(radians(45))), abs=2e-6)


def test_a_small_ball_leaves_no_rings_between_the_beams():
    """Ball 0.01 deg, beams of a rolling scanner every 0.25 deg of polar angle, out to 135 deg on either side."""
    seen = coverage(problem(ball_radius_deg=0.01), np.radians([0, 90, 0, -90]))
    assert seen.blind_fraction == pytest.approx(cap(radians(45 - 0.01)), abs=1e-5)


@pytest.mark.parametrize("setting_deg", [(0, 0, 50, 0), (40, -70, 10, 20), (-120, 15, 0, 80), (0, 0, 0, 0)])
@pytest.mark.parametrize("sensor", ["UTM-30LX", "URG-04LX"])
def test_random_directions_that_no_beam_comes_near_are_as_many(setting_deg, sensor):
    """At 18 s a ball of 2 deg reaches over several lines: what one scan misses, every start phase misses."""
    p, setting = problem([CONE], sensor), np.radians(setting_deg)
    d = np.random.default_rng(5).normal(size=(6000, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    axis = np.array(CONE["axis"]) / np.linalg.norm(CONE["axis"])
    d = d[d @ axis < cos(radians(25))]
    unseen = scan_tree(p, setting).query_ball_point(d, 2 * sin(radians(1)), return_length=True) == 0
    share = unseen.mean()
    noise = 4 * sqrt(share * (1 - share) / len(d)) + 1e-3
    assert coverage(p, setting).blind_fraction == pytest.approx(share, abs=noise)


def test_rolling_is_blind_behind_and_pitching_nowhere():
    """A fan of 270 deg rolled about its own front leaves 45 deg about the rear, less the ball."""
    rolling, pitching = (coverage(problem(), np.radians(s)) for s in ([0, 90, 0, -90], [-90, 0, 90, 0]))
    assert rolling.blind_fraction == pytest.approx(cap(radians(43)), abs=1e-6)
    assert pitching.blind_fraction == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_the_share_that_masks_hide_of_each_region_is_that_of_a_count(seed):
    """Rays through points of each region against the rectangle of the robot's top, in solid angle, without a field."""
    rng = np.random.default_rng(seed)
    height_m, width_m, tall_m = 0.45, rng.uniform(0.2, 0.5), rng.uniform(0.4, 0.9)
    walls = [
        {"shape": "wall", "distance_m": 1, "width_m": 2, "top_m": tall_m, "height_m": height_m, "heading_deg": side}
        for side in (90, -90)
    ]
    ground = {"shape": "ground", "from_m": 0.5, "to_m": 3, "width_m": 2, "height_m": height_m}
    top = {"shape": "ground", "height_m": 0.05, "from_m": -0.55, "to_m": 0.05, "width_m": width_m}
    task = {"name": "t", "sensor": "UTM-30LX", "servo": "MX-64R", "motion": {"period_s": 18.0}, "mask": [top]}
    loaded = LoadedTask(Task.model_validate(task | {"weight": [ground, *walls]}), Path(), load_catalogue(), ())
    x, z = rng.uniform(-1, 1, 200_000), rng.uniform(-height_m, tall_m - height_m, 200_000)
    on_robot = (x * 0.05 / -z >= -0.55) & (x * 0.05 / -z <= 0.05) & (0.05 / -z <= width_m / 2) & (z < 0)
    expected = np.average(on_robot, weights=(x**2 + 1 + z**2) ** -1.5)
    shares = [hidden_share(loaded, region) for region in loaded.task.weight]
    assert shares == pytest.approx([0, expected, expected], abs=0.004) and expected > 0.02
    left, right = hidden_regions(loaded)
    assert left.message.startswith("the robot hides ") and left.message.endswith(" to the left")
    assert right.value == pytest.approx(expected, abs=0.004) and right.message.endswith(" to the right")
    assert [each.severity for each in (left, right)] == ["warning" if expected > MOST_HIDDEN else "note"] * 2
    near = ground | {"from_m": 0.1, "to_m": 0.4, "width_m": width_m}
    behind = Task.model_validate(task | {"weight": [near], "mask": [top | {"to_m": 0.3}]})
    (most,) = hidden_regions(LoadedTask(behind, Path(), load_catalogue(), ()))
    assert most.severity == "warning" and most.value > MOST_HIDDEN and "move the scanner" in most.hint
    bare = LoadedTask(loaded.task.model_copy(update={"mask": ()}), Path(), loaded.products, ())
    assert hidden_regions(bare) == ()

"""What a scan leaves on planes, against a slow loop over lines and beams, and against discs tried one by one."""

import re
from math import cos, hypot, pi, radians, sin

import numpy as np
import pytest

from scanwright.design.evaluation.metres import AT_M, RING, SLACK, PlaneFigures, on_plane, on_planes, rounded
from scanwright.design.objective.problem import problem_of
from scanwright.design.task.task import load_task

GROUND = {"shape": "ground", "from_m": 1.0, "to_m": 3.8, "width_m": 2.0, "height_m": 0.5}
WALL = {"shape": "wall", "distance_m": 2.0, "width_m": 2.0, "height_m": 0.5, "top_m": 2.0, "heading_deg": 40.0}
SETTING_DEG = (20.0, 35.0, -30.0, 50.0)
LINES, BEAMS = 80, 683


def loaded(*weight, mask=()):
    """A scan of few lines, so that a loop can follow every beam."""
    return load_task(
        {
            "name": "t",
            "sensor": "URG-04LX",
            "servo": "MX-64R",
            "slip_ring": "UH1256-02-0610-06S",
            "motion": {"period_s": LINES / 10},
            "weight": list(weight),
            "mask": list(mask),
        }
    )


def turned(v, axis, angle):
    """A vector turned about x, y or z, written out."""
    x, y, z = v
    c, s = cos(angle), sin(angle)
    return {"x": (x, c * y - s * z, s * y + c * z), "y": (c * x + s * z, y, c * z - s * x)}.get(
        axis, (c * x - s * y, s * x + c * y, z)
    )


def rays(lidar):
    """Every beam of every line, R = Rx Ry Rz(gamma) Ry Rx, one rotation after the other."""
    alpha_rot, beta_rot, alpha_laser, beta_laser = (radians(a) for a in SETTING_DEG)
    for k in range(LINES):
        for bearing in lidar.bearings_rad():
            v = (cos(bearing), sin(bearing), 0.0)
            for axis, angle in [
                ("x", alpha_laser),
                ("y", beta_laser),
                ("z", 2 * pi * k / LINES),
                ("y", beta_rot),
                ("x", alpha_rot),
            ]:
                v = turned(v, axis, angle)
            yield v


@pytest.fixture(scope="module")
def beams():
    return list(rays(loaded(GROUND).lidar))


def on_ground(beams):
    """Where beams meet the ground, all of it: x and y."""
    return [(-0.5 * x / z, -0.5 * y / z) for x, y, z in beams if z < -1e-6]


def test_points_are_the_beams_that_end_there(beams):
    task = loaded(GROUND, WALL)
    assert len(beams) == LINES * len(task.lidar.bearings_rad())
    ground, wall = on_planes(task, problem_of(task), np.radians(SETTING_DEG))
    hits = [(x, y) for x, y in on_ground(beams) if 1 <= x <= 3.8 and abs(y) <= 1]
    assert ground.points == len(hits) > 100
    assert ground.points_per_m2 == pytest.approx(len(hits) / (2.8 * 2))
    count = 0
    for beam in beams:
        ahead, left, up = turned(beam, "z", -radians(40))
        count += ahead > 0 and abs(2 * left / ahead) <= 1 and 0 <= 0.5 + 2 * up / ahead <= 2
    assert wall.points == count > 100


def emptiest(points, k, places):
    """The largest distance from any place to its k-th nearest point, all of them looked at."""
    points = np.array(points)
    return max(np.partition(np.hypot(*(points - place).T), k - 1)[k - 1] for place in places)


def test_gaps_are_those_of_discs_tried_one_by_one(beams):
    task = loaded(GROUND)
    (found,) = on_planes(task, problem_of(task), np.radians(SETTING_DEG))
    points, step = on_ground(beams), 0.05
    places = [
        (x, y) for x in np.arange(1, 3.8 + step, step) for y in np.arange(-1, 1 + step, step) if x <= 3.8 and y <= 1
    ]
    ring = [(x, y) for x, y in places if abs(hypot(x, y, 0.5) - AT_M) <= RING * AT_M]
    assert found.at_m == AT_M
    for told_cm, tried_m in ((found.gap_cm, emptiest(points, 1, ring)), (found.twice_cm, emptiest(points, 2, places))):
        # between two places that are tried a wider disc may lie, by as much as they are apart
        assert 2 * tried_m <= told_cm / 100 * (1 + 1e-9)
        assert told_cm / 100 <= (2 * tried_m + 2 * step) * (1 + SLACK)


def test_the_spot_around_the_axis_is_told_apart_from_the_gaps_elsewhere():
    """An axis to a place 3 m away, which the fan goes around by 2 deg, and lines that are much closer than that."""
    task = load_task(
        {
            "name": "t",
            "sensor": "UST-10LX",
            "servo": "XM430-W350",
            "slip_ring": "UH1256-02-0610-06S",
            "motion": {"period_s": 20},
            "weight": [{"shape": "wall", "distance_m": 3.0, "width_m": 2.0, "height_m": 1.0, "top_m": 2.0}],
        }
    )
    (wall,) = on_planes(task, problem_of(task), np.radians((0.0, 90.0, 88.0, 0.0)))
    spot_cm = 2 * 300 * np.tan(np.radians(2.0))
    assert spot_cm <= wall.gap_cm <= 1.1 * spot_cm
    assert wall.gap_off_axis_cm < spot_cm / 2
    assert re.search(r"gaps of \S+ cm at 3 m, 2\d around the axis; an object", wall.words())
    (through,) = on_planes(task, problem_of(task), np.radians((0.0, 90.0, 90.0, 0.0)))
    assert through.gap_off_axis_cm == pytest.approx(through.gap_cm, rel=2 * SLACK)
    assert "around the axis" not in through.words()


@pytest.mark.parametrize("seed", range(4))
def test_the_area_without_points_is_that_of_the_blind_cone(seed):
    """A wall across the axis: the fan goes around a disc of it, and J counts a part of that as seen."""
    rng = np.random.default_rng(seed)
    cone_deg, distance_m, side_m = rng.uniform(3, 12), rng.uniform(2, 3), rng.uniform(1.6, 2.5)
    wall = {"shape": "wall", "distance_m": distance_m, "width_m": side_m, "height_m": side_m / 2, "top_m": side_m}
    task = load_task(
        {
            "name": "t",
            "sensor": "UST-10LX",
            "servo": "MX-64R",
            "slip_ring": "UH1256-02-0610-06S",
            "motion": {"period_s": 20},
            "weight": [wall],
        }
    )
    (found,) = on_planes(task, problem_of(task), np.radians((0.0, 90.0, 90.0 - cone_deg, 0.0)))
    spacing_deg = 360 / (20 * 40)  # of lines, more than that of beams
    disc_m2 = pi * (distance_m * np.tan(np.radians(cone_deg - spacing_deg))) ** 2
    assert found.empty_share == pytest.approx(disc_m2 / side_m**2, abs=0.005)
    warning = found.empty(radians(2.0))
    assert (warning is not None) == (found.empty_share > 0.01)
    assert warning is None or f"{100 * found.empty_share:.0f}% of the area of wall" in warning.message
    (swept,) = on_planes(task, problem_of(task), np.radians((0.0, 90.0, 90.0, 0.0)))
    assert swept.empty_share == 0
    assert swept.empty(radians(2.0)) is None


def test_what_is_masked_is_no_part_of_it_and_what_no_beam_reaches_is_said(beams):
    behind = {"shape": "band", "phi_deg": [0, 180]}
    task = loaded(GROUND, mask=[behind])
    (half,) = on_planes(task, problem_of(task), np.radians(SETTING_DEG))
    hits = [(x, y) for x, y in on_ground(beams) if 1 <= x <= 3.8 and -1 <= y < 0]
    assert half.points == len(hits)
    assert half.points_per_m2 == pytest.approx(len(hits) / 2.8, rel=0.02)
    left = [(x, y) for x, y in on_ground(beams) if y < 0]
    tried_m = emptiest(left, 2, [(x, y) for x in np.arange(1, 3.81, 0.05) for y in np.arange(-1, 0, 0.05)])
    assert 2 * tried_m <= half.twice_cm / 100 * (1 + 1e-9) <= (2 * tried_m + 0.1) * (1 + SLACK) * (1 + 1e-9)
    region = task.task.weight[0]
    none = on_plane(region, np.array([[0.0, 0.0, 1.0]]), problem_of(loaded(GROUND)), np.empty((0, 4)), 0.01, 4.0)
    inf = float("inf")
    assert none == PlaneFigures("ground 1 to 3.8 m ahead", 4.0, 0.0, 0, 0.0, 1.0, AT_M, inf, inf, inf)
    assert none.words() == "ground 1 to 3.8 m ahead: no beam of a full scan ends there"
    assert on_planes(loaded({"shape": "all"}), problem_of(loaded({"shape": "all"})), np.zeros(4)) == ()


def test_a_region_that_three_metres_do_not_reach_is_told_of_at_its_nearest():
    task = loaded(GROUND | {"to_m": 1.5})
    (found,) = on_planes(task, problem_of(task), np.radians(SETTING_DEG))
    assert found.at_m == pytest.approx(hypot(1.5, 1.0, 0.5), abs=0.02)
    assert f"at {found.at_m:.2g} m" in found.words()


def test_only_what_lies_within_the_range_counts(beams):
    """The URG-04LX sees 4 m: a wall 3.5 m away lies beyond in part, and of a large one around it the same is near."""
    assert loaded(GROUND).lidar.practical_range_m == 4.0
    figures = []
    for width_m in (6.0, 600.0):
        wall = {"shape": "wall", "distance_m": 3.5, "width_m": width_m, "height_m": 0.5, "top_m": 2.5}
        task = loaded(wall)
        figures += on_planes(task, problem_of(task), np.radians(SETTING_DEG))
    small, large = figures
    half_m = np.sqrt(4.0**2 - 3.5**2)
    y, z = np.meshgrid(np.linspace(-half_m, half_m, 2001), np.linspace(-0.5, 2.0, 2001))
    near_m2 = (y**2 + z**2 <= half_m**2).mean() * 2 * half_m * 2.5
    hits = [(3.5 * y / x, 3.5 * z / x) for x, y, z in beams if x > 1e-6]
    count = sum(-0.5 <= z <= 2.0 and hypot(3.5, y, z) <= 4.0 for y, z in hits)
    for found, area_m2 in ((small, 6.0 * 2.5), (large, 600.0 * 2.5)):
        assert found.points == count > 50
        assert found.beyond_range == pytest.approx(1 - near_m2 / area_m2, abs=2e-3)
        assert found.points_per_m2 == pytest.approx(count / near_m2, rel=0.03)
        assert "of it lies beyond the lidar's range of 4 m; of the rest " in found.words()
    assert (small.at_m, small.gap_cm) == (large.at_m, pytest.approx(large.gap_cm, rel=2 * SLACK))


def test_nothing_is_counted_where_nothing_is_in_range():
    task = loaded(WALL | {"distance_m": 500.0, "width_m": 100.0})
    (found,) = on_planes(task, problem_of(task), np.radians(SETTING_DEG))
    assert (found.points, found.points_per_m2, found.beyond_range) == (0, 0.0, 1.0)
    assert found.words() == (
        "wall 500 m away, 0 to 2 m high at 40 deg: 0 points, as all of it lies beyond the lidar's range of 4 m"
    )
    assert found.gap_cm == float("inf")


def test_a_large_number_is_no_power_of_ten():
    assert [rounded(value) for value in (0.123, 8.26, 99.4, 500.0, 1234.0)] == ["0.12", "8.3", "99", "500", "1,200"]

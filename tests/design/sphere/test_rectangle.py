"""Regions in metres: against rays that meet planes one by one, solid angles in closed form, and dense circles."""

from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import TaskError
from scanwright.design.sphere.directions import weighted_samples
from scanwright.design.sphere.outline import reach_about
from scanwright.design.sphere.rectangle import edge_normals, seen_rectangle
from scanwright.design.sphere.regions import field_of
from scanwright.design.task.task import LoadedTask, Task, load_task

GROUND = {"shape": "ground", "from_m": 0.5, "to_m": 5.0, "width_m": 4.0, "height_m": 0.4}
CEILING = {"shape": "ceiling", "height_m": 0.4, "ceiling_m": 2.6, "from_m": -1.0, "to_m": 3.0, "heading_deg": 20.0}
WALL = {"shape": "wall", "distance_m": 3.0, "width_m": 2.0, "bottom_m": -0.5, "height_m": 0.9, "heading_deg": -130.0}
WIDE = GROUND | {"from_m": -1.0, "to_m": 100.0, "width_m": 200.0}
THIN = GROUND | {"from_m": 50.0, "to_m": 51.0, "width_m": 0.02}
ALL = {"ground": GROUND, "ceiling": CEILING, "wall": WALL, "wide": WIDE, "thin": THIN}
TASK = {"name": "t", "sensor": "UTM-30LX", "servo": "AX-12A"}
TASK |= {"motion": {"mode": "sweep", "limits_deg": [-90, 90], "period_s": 9.0}}


def region(table):
    return Task.model_validate(TASK | {"weight": [table]}).weight[0]


def field(*tables, mask=()):
    task = Task.model_validate(TASK | {"weight": list(tables), "mask": list(mask)})
    return field_of(LoadedTask(task, Path(), load_catalogue(), ()))


def ray_meets(table, d):
    """Whether a ray from the centre meets the rectangle: where it pierces the plane, and what holds that point."""
    turn = radians(table.get("heading_deg", 0.0))
    x, y, z = d[0] * cos(turn) + d[1] * sin(turn), d[1] * cos(turn) - d[0] * sin(turn), d[2]
    height, half = table["height_m"], table.get("width_m", 4.0) / 2
    if table["shape"] == "wall":
        if x <= 0:
            return False
        far = table["distance_m"] / x
        return abs(far * y) <= half and table["bottom_m"] <= far * z + height <= table.get("top_m", 2.5)
    level = -height if table["shape"] == "ground" else table["ceiling_m"] - height
    far = level / z
    return far > 0 and table["from_m"] <= far * x <= table["to_m"] and abs(far * y) <= half


@pytest.mark.parametrize("name", ALL)
def test_a_direction_is_in_a_region_when_its_ray_meets_it(name):
    table = ALL[name]
    rng = np.random.default_rng(3)
    corners = np.array(region(table).corners_m())
    near = corners[rng.integers(0, 4, 2000)] + rng.normal(size=(2000, 3)) * 0.3 * np.ptp(corners, axis=0).max()
    d = near / np.linalg.norm(near, axis=1)[:, None]
    met = [ray_meets(table, one) for one in d]
    assert 20 < sum(met) < 1980 or name == "thin"
    np.testing.assert_array_equal(field(table).weight_at(d) > 0, met)
    hidden = field({"shape": "all"}, mask=[table])
    np.testing.assert_array_equal(hidden.masked_at(d), met)


def solid_angle_of_triangle(a, b, c):
    """A. van Oosterom and J. Strackee, "The solid angle of a plane triangle", 1983."""
    return 2 * np.arctan2(abs(a @ np.cross(b, c)), 1 + a @ b + b @ c + c @ a)


@pytest.mark.parametrize("name", ALL)
def test_its_solid_angle_and_its_directions(name):
    corners = np.array(region(ALL[name]).corners_m())
    normals = edge_normals(corners)
    seen = seen_rectangle(normals)
    unit = corners / np.linalg.norm(corners, axis=1)[:, None]
    triangles = solid_angle_of_triangle(*unit[:3]) + solid_angle_of_triangle(unit[0], unit[2], unit[3])
    rng = np.random.default_rng(1)
    d, solid_angle = seen.spread(rng.random(20_000), rng.random(20_000))
    assert solid_angle == pytest.approx(triangles, rel=1e-7)
    assert (d @ normals.T).min() > -1e-12
    # equal shares of the solid angle hold equal numbers of directions: halves cut by a plane through two corners
    first = solid_angle_of_triangle(*unit[:3]) / triangles
    side = d @ np.cross(unit[0], unit[2])
    inside = (side * (unit[1] @ np.cross(unit[0], unit[2])) > 0).mean()
    assert abs(inside - first) < 4 * np.sqrt(first * (1 - first) / len(d))


@pytest.mark.parametrize("name", ["ground", "ceiling", "wall"])
def test_circles_through_it_and_how_far_it_reaches(name):
    axis = np.array([0.3, -0.5, 0.81])
    axis /= np.linalg.norm(axis)
    f = field(ALL[name])
    polar = np.linspace(0.02, np.pi - 0.02, 60)
    mean, _ = f.on_circles(axis, polar)
    e1 = np.cross(axis, [0, 0, 1]) / np.linalg.norm(np.cross(axis, [0, 0, 1]))
    turn = 2 * np.pi * np.arange(20_000) / 20_000
    ring = np.cos(turn)[:, None] * e1 + np.sin(turn)[:, None] * np.cross(axis, e1)
    dense = [f.weight_at(np.cos(t) * axis + np.sin(t) * ring).mean() for t in polar]
    np.testing.assert_allclose(mean, dense, atol=3e-4)
    low, high = reach_about(f, axis[None])[0]
    samples = weighted_samples(f, 20_000)
    angle = np.arccos(samples.directions @ axis)
    assert low <= angle.min() + 1e-6 and angle.max() <= high + 1e-6
    assert angle.min() - low < 0.02 and high - angle.max() < 0.02
    seen = seen_rectangle(edge_normals(np.array(region(ALL[name]).corners_m())))
    assert samples.weights.sum() == pytest.approx(seen.spread(np.zeros(1), np.zeros(1))[1], rel=1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (GROUND | {"to_m": 0.5}, "to_m = 0.5 is not above from_m = 0.5"),
        (GROUND | {"height_m": -1}, "height_m = -1"),
        (CEILING | {"ceiling_m": 0.3}, "ceiling_m = 0.3 is not above height_m = 0.4"),
        (WALL | {"top_m": -1}, "top_m = -1 is not above bottom_m = -0.5"),
        (GROUND | {"from_m": 9000, "to_m": 9001}, "deg thin: 0.001 deg or more are needed; its lengths are in metres"),
        (GROUND | {"ceiling_m": 2}, "ceiling_m: unknown key"),
    ],
)
def test_a_rectangle_that_cannot_be(change, says):
    with pytest.raises(ValidationError):
        region(change)
    with pytest.raises(TaskError) as told:
        load_task(TASK | {"weight": [change]})
    assert says in str(told.value)


def test_it_is_called_by_where_it_lies():
    assert region(GROUND).words() == "ground 0.5 to 5 m ahead"
    assert region(WALL | {"heading_deg": 90}).words() == "wall 3 m away, -0.5 to 2.5 m high to the left"
    assert region(CEILING).words() == "ceiling at 2.6 m, -1 to 3 m at 20 deg"

"""Tasks in a scene: surfaces, boxes, robots that hide, points per square metre against a scan cast into the mesh."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scans import simulated_scan

from scanwright.design.errors import TaskError
from scanwright.design.evaluation.coverage import on_surfaces, points_per_m2
from scanwright.design.objective.ball_search import start_phases
from scanwright.design.objective.problem import problem_of
from scanwright.design.scene.ray_caster import cast, load_scene
from scanwright.design.task.task import load_task

ROOM = (8.0, 6.0, 3.0)  # from the origin
SENSOR = (3.0, 2.5, 1.2)

TASK = """
name = "room"
sensor = "UTM-30LX"
servo = "MX-64R"
slip_ring = "UH1256-02-0610-06S"
[motion]
period_s = 3.0
[density]
ball_radius_deg = 1.0
[scene]
file = "room.stl"
sensor_m = [3.0, 2.5, 1.2]
rpy_deg = [0, 0, 30]
step_deg = 1.0
[[weight]]
shape = "box"
min_m = [7.9, 1.0, 0.5]
max_m = [8.1, 5.0, 2.0]
"""


@pytest.fixture
def room(tmp_path):
    trimesh.creation.box(bounds=[(0, 0, 0), ROOM]).export(tmp_path / "room.stl")
    trimesh.creation.box(extents=(400, 300, 200)).export(tmp_path / "robot.stl")
    (tmp_path / "task.toml").write_text(TASK, encoding="utf-8")
    return tmp_path


def turned(text, *pairs):
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


def test_a_box_weighs_the_wall_in_it_by_its_area(room):
    """The weight over the sphere is the area of the wall patch, 4 x 1.5 m, seen from inside."""
    problem = problem_of(load_task(room / "task.toml"))
    z = 1 - 2 * (np.arange(4000) + 0.5) / 4000
    means, _ = problem.field.on_circles(np.array([0.0, 0.0, 1.0]), np.arccos(z))
    assert 4 * np.pi * means.mean() == pytest.approx(4.0 * 1.5, rel=0.03)  # cells of 1 deg


def test_points_per_square_metre_are_those_of_a_scan_cast_into_the_mesh(room):
    loaded = load_task(room / "task.toml")
    problem = problem_of(loaded)
    setting = np.radians([0, 90, 0, -60])
    scene = load_scene(room / "room.stl")
    yaw = np.radians(30)
    R = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    hits = []
    for phase in start_phases(problem.lines.count, problem.lines.step_rad):
        beams = simulated_scan(problem.bearings_rad, problem.lines, setting, phase) @ R.T
        points = np.array(SENSOR) + cast(scene, np.array(SENSOR), beams).range_m[:, None] * beams
        inside = (points > [7.9, 1.0, 0.5]).all(axis=1) & (points < [8.1, 5.0, 2.0]).all(axis=1)
        hits.append(inside.sum())
    density = points_per_m2(problem, setting, loaded.surface).ravel()
    directions = loaded.surface.directions.reshape(-1, 3)
    weight = problem.field.weight_at(directions) * np.sqrt(1 - directions[:, 2] ** 2)
    assert density @ weight / weight.sum() == pytest.approx(np.mean(hits) / (4.0 * 1.5), rel=0.03)
    told = on_surfaces(problem, setting, loaded.surface)
    assert told["lowest_points_per_m2"] <= told["median_points_per_m2"]


def test_what_is_out_of_range_or_behind_the_robot_is_left_out(room):
    near = turned(TASK, ("UTM-30LX", "URG-04LX"))  # 4 m: the far corners are out of range
    robot = '[[mask]]\nshape = "mesh"\nfile = "robot.stl"\nunit_m = 0.001\nsensor_m = [0, 0, 0.25]\n'
    (room / "near.toml").write_text(near.replace('box"', 'all"').split("min_m")[0] + robot, encoding="utf-8")
    loaded = load_task(room / "near.toml")
    field = problem_of(loaded).field
    directions = loaded.surface.directions.reshape(-1, 3)
    far = loaded.surface.range_m.ravel() > 4.0
    assert far.any() and field.masked_at(directions)[far].all()
    down = np.array([[0.0, 0.0, -1.0], [0.3, 0.2, -1.0]])
    assert field.masked_at(down / np.linalg.norm(down, axis=1)[:, None]).all()  # the robot's top, 0.15 m below
    assert not field.masked_at(np.array([[0.0, 0.0, 1.0]])).any()


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("room.stl", "roof.stl", "roof.stl: no such file"),
        ("[3.0, 2.5, 1.2]", "[300.0, 2.5, 1.2]", "no ray from there hits the mesh"),
        ("max_m = [8.1, 5.0, 2.0]", "max_m = [7.0, 5.0, 2.0]", "is not below max_m"),
        ("step_deg = 1.0", "step_deg = 0.7", "only with a step that divides 180"),
        ("min_m = [7.9, 1.0, 0.5]", "min_m = [7.99, 1.0, 50]\nvalue = 0", "max_m"),
    ],
)
def test_wrong_scenes_are_one_line(room, command, old, new, words):
    (room / "task.toml").write_text(turned(TASK, (old, new)), encoding="utf-8")
    code, _, err = command("evaluate", room / "task.toml", "--angles=0,90,0,-90")
    assert code == 2 and len(err) == 1 and words in err[0]


def test_a_box_without_a_scene_is_refused(room):
    (room / "task.toml").write_text(TASK.split("[scene]")[0] + "[[weight]]" + TASK.split("[[weight]]")[1])
    with pytest.raises(TaskError, match="requires a \\[scene\\]"):
        load_task(room / "task.toml")


def test_an_office_is_read_as_it_is(data, tmp_path):
    """DAE with its own unit; the robot of the task below the scanner."""
    text = turned(
        TASK,
        ('"room.stl"', f'"{data / "meshes" / "office.dae"}"'),
        ("[3.0, 2.5, 1.2]", "[0.0, 0.0, 1.0]"),
        ("1.0\n[[", "4.0\n[["),
    )
    text = text.split("[[weight]]")[0] + '[[weight]]\nshape = "all"\n'
    (tmp_path / "office.toml").write_text(text, encoding="utf-8")
    loaded = load_task(Path(tmp_path / "office.toml"))
    down = loaded.surface.range_m[-1]
    np.testing.assert_allclose(down * np.cos(np.radians(2)), 1.0, atol=0.02)  # the floor

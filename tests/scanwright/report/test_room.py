"""The room of the stage: its size, and where its camera stands."""

from base64 import b64decode

import numpy as np
import pytest
import trimesh

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.objective.problem import problem_of
from scanwright.design.task.task import load_task
from scanwright.report.density_sphere import density_sphere
from scanwright.report.room import room_about, room_scene
from scanwright.report.scanner_scene import robot_bodies

GROUND = {"shape": "ground", "from_m": 0.5, "to_m": 3.0, "width_m": 2.0, "height_m": 0.4}


def task(**keys):
    told = {"name": "t", "sensor": "UTM-30LX", "servo": "MX-64R", "slip_ring": "SNU11-P0210"}
    return load_task(told | {"motion": {"period_s": 18.0}, "weight": [GROUND]} | keys)


def test_the_room_is_that_of_the_task():
    room = room_about(task().task)
    np.testing.assert_allclose(room.low, [-1.0, -2.0, -0.4])
    np.testing.assert_allclose(room.high, [3.0, 2.0, 2.1])
    usual = room_about(load_task("ground_ahead").task)
    np.testing.assert_allclose([usual.low, usual.high], [[-2, -2, -1], [2, 2, 1.5]])


@pytest.mark.parametrize(
    ("theta_deg", "below", "pitch_deg"), [([0, 60], 0.0, -28), ([0, 120], 1 / 3, 28), ([90, 180], 1.0, 28)]
)
def test_a_task_that_looks_up_only_is_seen_from_below(theta_deg, below, pitch_deg):
    loaded = task(weight=[{"shape": "band", "theta_deg": theta_deg}])
    flat = Angles(alpha_rot=0, beta_rot=0, alpha_laser=90, beta_laser=0)
    angles = AngleSet(task="t", angles_deg=flat, sensor="UTM-30LX", servo="MX-64R")
    sphere = density_sphere(problem_of(loaded), angles, (), None)
    assert sphere.below == pytest.approx(below, abs=0.01)
    centre_m = np.array([0.1, 0.2, 0.3])
    scene = room_scene(room_about(loaded.task), centre_m, np.array(sphere.middle), sphere.below)
    assert scene["look"]["pitch"] == pytest.approx(np.radians(pitch_deg), abs=1e-4)
    end = scene["room"]["high" if pitch_deg < 0 else "low"]
    assert scene["level"] == end[2] and scene["centre"] == centre_m.tolist()


def test_the_camera_stands_behind_the_scanner():
    """It looks along the middle of what counts, 35 deg from the side."""
    scene = room_scene(room_about(task().task), np.zeros(3), np.array([0.0, 0.8, -0.6]), 1.0)
    eye = np.array([np.cos(scene["look"]["yaw"]), np.sin(scene["look"]["yaw"])])
    assert eye @ [0, 1] == pytest.approx(-np.cos(np.radians(35)), abs=1e-3)


def test_a_robot_stands_where_its_mesh_is(tmp_path):
    mesh = trimesh.creation.box((0.6, 0.4, 0.2))
    mesh.apply_translation([0, 0, 0.1])
    mesh.export(tmp_path / "robot.stl")
    mask = {"shape": "mesh", "file": str(tmp_path / "robot.stl"), "sensor_m": [0.2, 0.0, 0.4]}
    centre_m = np.array([0.1, 0.0, 0.5])
    (robot,) = robot_bodies(task(mask=[mask]).task, tmp_path, centre_m)
    T = np.reshape(robot["matrix"], (4, 4)).T
    box = [T[:3, 3], T[:3, 3] + np.diag(T)[:3]]
    np.testing.assert_allclose(box - centre_m, [[-0.5, -0.2, -0.4], [0.1, 0.2, -0.2]], atol=1e-6)
    assert len(np.frombuffer(b64decode(robot["faces"]), "<u2")) == 36

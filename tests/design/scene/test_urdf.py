"""The robot of a URDF as a mask: links by the values of their joints, meshes found and scaled, faults in one line."""

import logging

import numpy as np
import pytest
import trimesh

from scanwright.design.errors import SceneError, TaskError
from scanwright.design.scene.posture import Posture
from scanwright.design.scene.ray_caster import load_triangles
from scanwright.design.scene.urdf import urdf_triangles
from scanwright.design.task.task import load_task
from scanwright.pipeline.records import write_task

ROBOT = """<robot name="r">
  <link name="base"><visual><geometry><box size="0.4 0.4 0.2"/></geometry></visual></link>
  <link name="arm"><visual><origin xyz="0.5 0 0"/><geometry><mesh filename="package://robot/meshes/arm.stl"
    scale="0.001 0.001 0.001"/></geometry></visual></link>
  <link name="finger"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
  <link name="scanner"><visual><geometry><cylinder radius="0.1" length="0.1"/></geometry></visual></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.3"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="slide" type="prismatic"><parent link="arm"/><child link="finger"/><origin xyz="1 0 0"/>
    <axis xyz="1 0 0"/></joint>
  <joint name="mount" type="fixed"><parent link="base"/><child link="scanner"/>
    <origin xyz="0 0 0.5" rpy="0 0 1.5707963267948966"/></joint>
</robot>"""


@pytest.fixture
def robot(tmp_path):
    (tmp_path / "robot/urdf").mkdir(parents=True)
    (tmp_path / "robot/meshes").mkdir()
    trimesh.creation.box([100, 100, 100]).export(tmp_path / "robot/meshes/arm.stl")
    path = tmp_path / "robot/urdf/robot.urdf"
    path.write_text(ROBOT)
    return path


def centres(path, **posture):
    """Middles of base, arm, finger and scanner, by their numbers of triangles."""
    triangles = urdf_triangles(path, Posture(**posture))
    ends = np.cumsum([12, 12, 1280])
    parts = np.split(triangles.reshape(len(triangles), 9), ends)
    corners = [part.reshape(-1, 3) for part in parts]
    return [(part.min(axis=0) + part.max(axis=0)) / 2 for part in corners if len(part)]


def test_links_are_placed_by_the_values_of_their_joints(robot):
    base, arm, finger, scanner = centres(robot, joint_deg={"shoulder": 90.0}, joint_mm={"slide": 200.0})
    np.testing.assert_allclose(base, [0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(arm, [0, 0.5, 0.3], atol=1e-9)
    np.testing.assert_allclose(finger, [0, 1.2, 0.3], atol=1e-9)
    np.testing.assert_allclose(scanner, [0, 0, 0.5], atol=1e-9)


def test_triangles_are_in_the_frame_of_a_link_and_without_others(robot):
    base, arm, _ = centres(robot, frame="scanner", omit=("scanner",))
    np.testing.assert_allclose(base, [0, 0, -0.5], atol=1e-9)
    np.testing.assert_allclose(arm, [0, -0.5, -0.2], atol=1e-9)


def test_a_joint_that_mimics_follows(robot):
    robot.write_text(
        ROBOT.replace('<parent link="arm"/>', '<mimic joint="shoulder" multiplier="2"/><parent link="arm"/>')
    )
    finger = centres(robot, joint_deg={"shoulder": 90.0})[2]
    np.testing.assert_allclose(finger, [0, 1 + np.pi, 0.3], atol=1e-9)


def test_joints_that_mimic_in_a_circle_are_at_rest(robot):
    circle = ROBOT.replace('<parent link="arm"/>', '<mimic joint="shoulder"/><parent link="arm"/>')
    robot.write_text(circle.replace('<child link="arm"/>', '<mimic joint="slide"/><child link="arm"/>'))
    np.testing.assert_allclose(centres(robot)[1], [0.5, 0, 0.3], atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "posture", "says"),
    [
        ("arm.stl", "leg.stl", {}, "link 'arm': no mesh 'package://robot/meshes/leg.stl'"),
        ("<robot", "<robots", {}, "not a readable URDF"),
        ("<geometry>", "<xacro.x/><geometry>", {}, "contains xacro"),
        ('xyz="0 0 0.3"', 'xyz="0 0 up"', {}, "robot.urdf: could not convert string to float: 'up'"),
        ('size="0.4 0.4 0.2"', 'size="0.4 0.2"', {}, "link 'base': box: size = '0.4 0.2': allowed 3 finite numbers"),
        ('parent link="base"/><child link="arm"', 'parent link="bas"/><child link="arm"', {}, "not connected"),
        ("", "", {"joint_deg": {"sholder": 1.0}}, "no joint 'sholder'; did you mean 'shoulder'"),
        ("", "", {"frame": "scaner"}, "no link 'scaner'; did you mean 'scanner'"),
    ],
)
def test_faults_are_one_line(robot, old, new, posture, says):
    robot.write_text(ROBOT.replace(old, new))
    with pytest.raises(SceneError, match=says) as error:
        urdf_triangles(robot, Posture(**posture))
    assert "\n" not in str(error.value)


TASK = """name = "t"
sensor = "UST-10LX"
servo = "XM430-W350"
slip_ring = "SRC022A-6"
motion = { period_s = 10.0 }
[[weight]]
shape = "all"
[[mask]]
shape = "mesh"
step_deg = 5
"""


@pytest.mark.usefixtures("robot")
def test_a_urdf_masks_and_the_build_folder_keeps_it_as_one_mesh(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    keys = 'file = "robot/urdf/robot.urdf"\nframe = "scanner"\nomit = ["scanner"]\njoint_deg = { shoulder = 90 }\n'
    (tmp_path / "t.toml").write_text(TASK + keys)
    loaded = load_task(tmp_path / "t.toml")
    assert 0.01 < loaded.maps[0].mean() < 0.3
    assert any("robot.urdf: 1.2" in line and "unit_m = 1" in line for line in caplog.messages)
    (tmp_path / "out").mkdir()
    write_task(tmp_path / "out", loaded)
    again = load_task(tmp_path / "out/task.toml")
    np.testing.assert_array_equal(again.maps[0], loaded.maps[0])
    assert again.sha256() == loaded.sha256()


@pytest.mark.parametrize(("size", "unit", "becomes"), [(600.0, "0.001", "0.6 m"), (0.0006, "1000", "0.6 m")])
def test_a_mesh_of_implausible_size_needs_its_unit(tmp_path, size, unit, becomes):
    trimesh.creation.box([size, size / 2, size / 2]).export(tmp_path / "m.stl")
    (tmp_path / "t.toml").write_text(TASK + 'file = "m.stl"\n')
    with pytest.raises(
        TaskError, match=rf"{size:g} m across and hides every direction: write unit_m; {unit} makes it {becomes}"
    ):
        load_task(tmp_path / "t.toml")
    (tmp_path / "t.toml").write_text(TASK + f'file = "m.stl"\nunit_m = {unit}\nsensor_m = [0, 0, 1]\n')
    assert load_task(tmp_path / "t.toml").maps[0].any()
    np.testing.assert_allclose(
        np.ptp(load_triangles(tmp_path / "m.stl", float(unit)), axis=(0, 1)).max(), 0.6, rtol=1e-6
    )

"""`out/<task>/ros2/`: a package that colcon builds, whose share folder is a scanner as the build folder is.

Where `SCANWRIGHT_ROS` names a Python with rclpy and colcon (CI makes one), colcon builds it, and the program that it
installs is started; its launch files need a whole ROS 2 and are looked at here without one.
"""

import json
import os
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from patience import BOUND_S

from scanwright.design.angles import Angles, AngleSet, load_angles
from scanwright.firmware_io.ros.robot_frames import description, fixed_frames
from scanwright.pipeline.ros2 import description_launch, node
from scanwright.pipeline.ros2.package import package_name, write_package

ROS = os.environ.get("SCANWRIGHT_ROS")
COLCON = Path(ROS).with_name("colcon") if ROS else None
ANGLES = AngleSet(
    task="Ground-2 ahead",
    angles_deg=Angles(alpha_rot=10, beta_rot=-30, alpha_laser=60, beta_laser=20),
    t_rot_laser_mm=(3, 4, 0),
    t_world_rot_mm=(1, 2, 130),
    sensor="URG-04LX",
    servo="MX-64R",
    motion={"mode": "spin", "period_s": 18.0},
)
NAME = "ground_2_ahead_scanner"


@pytest.fixture
def build(tmp_path):
    """What a build folder holds of it."""
    folder = tmp_path / "build"
    (folder / "parts").mkdir(parents=True)
    (folder / "angles.json").write_text(ANGLES.to_json())
    np.savez(folder / "own_body.npz", beams=np.zeros(2, bool), bearing_rad=np.arange(2.0))
    urdf = (Path(__file__).parents[2] / "firmware_io/ros/scanner.urdf").read_text()
    (folder / "scanner.urdf").write_text(urdf.replace("package://mine/", "parts/"))
    for mesh in ("base.stl", "rot.stl"):
        (folder / "parts" / mesh).write_bytes(mesh.encode())
    write_package(folder)
    return folder


@pytest.mark.parametrize(
    ("task", "name"),
    [("ground_ahead", "ground_ahead_scanner"), ("Ground-2 ahead", NAME), ("360 view", "task_360_view_scanner")],
)
def test_a_package_is_named_as_ros_wants_it(task, name):
    assert package_name(task) == name


def test_it_says_what_a_package_of_ament_python_says(build):
    root = build / "ros2"
    package = ElementTree.parse(root / "package.xml").getroot()
    assert package.attrib == {"format": "3"}
    assert package.findtext("name") == NAME
    assert package.findtext("export/build_type") == "ament_python"
    assert (root / "resource" / NAME).read_text() == ""
    assert f"script_dir=$base/lib/{NAME}" in (root / "setup.cfg").read_text()
    assert "THIS_PACKAGE" not in "".join(path.read_text() for path in root.rglob("*.py"))
    assert "Decay Time: 18" in (root / "layouts/scanner.rviz").read_text()
    scene = json.loads((root / "layouts/foxglove.json").read_text())["configById"]["3D!scanner"]
    assert scene["topics"]["/points"]["decayTime"] == 18.0


def test_its_folder_is_a_scanner_with_meshes_of_the_package(build):
    root = build / "ros2"
    assert load_angles(root / "angles.json") == ANGLES
    robot = ElementTree.fromstring(description(root, ANGLES))
    assert robot.find(".//mesh").get("filename") == f"package://{NAME}/meshes/base.stl"
    assert (root / "meshes/base.stl").read_bytes() == b"base.stl"
    origin = robot.find("joint[@name='laser_mount']/origin")
    assert (origin.get("xyz"), origin.get("rpy")) == (fixed_frames(ANGLES)[1].xyz, fixed_frames(ANGLES)[1].rpy)


def test_launch_parameters_of_a_calibration_take_the_place_of_the_designed_frames(build):
    urdf = (build / "ros2/scanner.urdf").read_text()
    laser = fixed_frames(ANGLES.model_copy(update={"t_rot_laser_mm": (7.0, 8.0, 0.0)}))[1]
    said = dict(word.split(":=") for word in laser.launch_parameters().replace("' ", "'\n").splitlines())
    assert said.keys() <= set(description_launch.FRAMES)
    told = description_launch.with_frames(urdf, lambda name: said.get(name, "").strip("'"))
    joints = {joint.get("name"): joint.find("origin").attrib for joint in ElementTree.fromstring(told).iter("joint")}
    before = {joint.get("name"): joint.find("origin") for joint in ElementTree.fromstring(urdf).iter("joint")}
    assert joints["laser_mount"] == {"xyz": laser.xyz, "rpy": laser.rpy}
    assert joints["servo_mount"] == before["servo_mount"].attrib


@pytest.mark.parametrize(
    ("words", "becomes"),
    [
        ([], ["ros2", "--", "SHARE"]),
        (["--ros-args", "-r", "a:=b"], ["ros2", "--", "SHARE", "--ros-args", "-r", "a:=b"]),
        (["out/x", "--no-tf", "--ros-args"], ["ros2", "--no-tf", "--", "out/x", "--ros-args"]),
    ],
)
def test_its_program_is_the_command_with_the_package_as_its_scanner(words, becomes):
    assert node.command(words, "SHARE") == becomes


@pytest.mark.skipif(
    COLCON is None or not COLCON.exists(), reason="SCANWRIGHT_ROS names no Python with colcon beside it (CI makes one)"
)
def test_colcon_builds_it_and_its_program_starts(build, tmp_path):
    space = tmp_path / "space"
    env = {**os.environ, "PATH": f"{COLCON.parent}{os.pathsep}{os.environ['PATH']}", "HOME": str(tmp_path)}
    words = [COLCON, "build", "--base-paths", build / "ros2", "--build-base", space / "build"]
    words += ["--install-base", space / "install", "--merge-install", "--event-handlers", "console_direct+"]
    done = subprocess.run([*map(str, words)], env=env, cwd=tmp_path, capture_output=True, text=True, timeout=BOUND_S)
    assert done.returncode == 0, done.stdout + done.stderr
    share = space / "install/share" / NAME
    assert (space / "install/share/ament_index/resource_index/packages" / NAME).exists()
    made = {path.relative_to(share).as_posix() for path in share.rglob("*") if path.is_file()}
    assert made >= {
        "package.xml",
        "scanner.urdf",
        "angles.json",
        "own_body.npz",
        "meshes/base.stl",
        "launch/scanner_launch.py",
        "launch/description_launch.py",
        "layouts/scanner.rviz",
        "layouts/foxglove.json",
    }
    started = {**env, "AMENT_PREFIX_PATH": str(space / "install"), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    packages = sorted((space / "install/lib").glob("python*/site-packages"))
    started["PYTHONPATH"] = os.pathsep.join(map(str, packages))
    program = space / "install/lib" / NAME / "scanner"
    missing = ["--recording", str(tmp_path / "none.mcap")]
    ran = subprocess.run([ROS, program, *missing], env=started, capture_output=True, text=True, timeout=BOUND_S)
    assert (ran.returncode, "none.mcap: no such file" in ran.stderr) == (2, True), ran.stderr

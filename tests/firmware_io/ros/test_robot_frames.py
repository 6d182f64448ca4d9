"""Calibrated frames on a robot: a URDF library and a shell see the very frames of the angle set."""

import shlex
from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from scipy.spatial.transform import Rotation

from scanwright.design.angles import Angles, AngleSet, angles_in_use
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.ros.robot_frames import (
    calibrated_urdf_place,
    fixed_frames,
    what_changed,
    with_frames,
    write_calibrated_urdf,
)

DESIGNED = AngleSet(
    task="frames",
    angles_deg=Angles(alpha_rot=20, beta_rot=-35, gamma_rot=15, alpha_laser=40, beta_laser=-60),
    t_world_rot_mm=(10, -20, 130),
    sensor="UTM-30LX",
    servo="MX-64R",
)
CALIBRATED = DESIGNED.model_copy(
    update={
        "source": "calibration",
        "delta_rotvec_rot_deg": (0.3, -0.4),
        "t_rot_laser_mm": (3.0, -4.0, 0.0),
        "covariance": tuple(tuple(row) for row in np.diag([1e-8, 1e-8, 1e-8, 1e-8]).tolist()),
    }
)
URDF = (Path(__file__).parent / "scanner.urdf").read_text()


def test_a_urdf_library_sees_the_chain_of_the_calibrated_angles(tmp_path):
    (tmp_path / "build").mkdir()
    (tmp_path / "build/scanner.urdf").write_text(URDF)
    out = tmp_path / "elsewhere" / "scanner.calibrated.urdf"
    out.parent.mkdir()
    write_calibrated_urdf(tmp_path / "build/scanner.urdf", out, CALIBRATED)
    text = out.read_text()
    assert "<!-- kept -->" in text and text.startswith("<?xml")
    assert 'filename="../build/parts/base.stl"' in text and 'filename="package://mine/rot.stl"' in text
    robot = yourdfpy.URDF.load(str(out), load_meshes=False, build_collision_scene_graph=False)
    for joint_rad in (0.0, 1.3, -2.9):
        robot.update_cfg([joint_rad])
        np.testing.assert_allclose(
            robot.get_transform("laser", "world"), CALIBRATED.T_world_laser(joint_rad), atol=1e-10
        )


def test_the_commands_publish_the_frames():
    frames = fixed_frames(CALIBRATED)
    for frame, T in zip(frames, (CALIBRATED.T_world_rot(0.0), CALIBRATED.T_rot_laser()), strict=True):
        words = shlex.split(frame.command())
        assert words[:4] == ["ros2", "run", "tf2_ros", "static_transform_publisher"]
        told = dict(zip(words[4::2], words[5::2], strict=True))
        assert (told["--frame-id"], told["--child-frame-id"]) == (frame.parent, frame.child)
        rpy = [float(told[f"--{name}"]) for name in ("roll", "pitch", "yaw")]
        np.testing.assert_allclose(Rotation.from_euler("xyz", rpy).as_matrix(), T[:3, :3], atol=1e-10)
        np.testing.assert_allclose([float(told[f"--{axis}"]) for axis in "xyz"], T[:3, 3], atol=1e-12)
        xyz, rpy_words = shlex.split(frame.launch_parameters())
        assert xyz == f"{frame.joint}_xyz:={frame.xyz}" and rpy_words == f"{frame.joint}_rpy:={frame.rpy}"


def test_what_changed_is_said_in_words():
    lean, shift, most = what_changed(DESIGNED, CALIBRATED)
    assert lean == (
        "lidar tilt: 0.500 deg (sigma 0.0081) from the design: +0.300 about x, -0.400 about y of the rotation frame"
    )
    assert "5.00 mm (sigma 0.14) from the design: +3.00 along x, -4.00 along y" in shift
    assert "effect at 10 m: up to 92.3 mm" in most  # 10 m times 0.5 deg, and 5 mm
    assert what_changed(DESIGNED, DESIGNED)[0].startswith("lidar tilt: 0.000 deg from")


@pytest.mark.parametrize(("text", "says"), [("<robot", "no URDF"), ("<robot/>", "no joint 'servo_mount'")])
def test_what_is_no_urdf_of_a_build_is_refused(text, says):
    with pytest.raises(RecordingError, match=f"mine.urdf: {says}"):
        with_frames(text, CALIBRATED, "mine.urdf")


def test_a_build_folder_runs_with_the_calibration_of_its_own_mount(tmp_path):
    (tmp_path / "angles.json").write_text(DESIGNED.to_json())
    assert angles_in_use(tmp_path).angles == DESIGNED
    (tmp_path / "angles.calibrated.json").write_text(CALIBRATED.to_json())
    in_use = angles_in_use(tmp_path)
    assert (in_use.angles, in_use.path.name) == (CALIBRATED, "angles.calibrated.json")
    assert "as calibrated" in in_use.description
    moved = DESIGNED.model_copy(update={"t_world_rot_mm": (10, -20, 131)})  # built again
    (tmp_path / "angles.json").write_text(moved.to_json())
    in_use = angles_in_use(tmp_path)
    assert (in_use.angles, in_use.path.name) == (moved, "angles.json")
    assert "is of another mount" in in_use.description


def test_the_urdf_is_named_after_the_angle_set(tmp_path):
    assert calibrated_urdf_place(tmp_path / "angles.calibrated.json") == tmp_path / "scanner.calibrated.urdf"
    assert calibrated_urdf_place(tmp_path / "again.json") == tmp_path / "again.urdf"

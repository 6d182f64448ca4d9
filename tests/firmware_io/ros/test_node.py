"""The node in a real ROS 2: somebody else's program rebuilds the cloud; parameters and lost listeners do no harm.

ROS 2 comes as wheels that start the interpreter anew, so it has a Python of its own: `SCANWRIGHT_ROS`, which CI makes.
Every process is found on this computer only.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from patience import BOUND_S, until

from benchmarks.firmware_io.rooms import FURNISHED, Setup, Truth, simulate, write
from scanwright.design.angles import Angles, AngleSet
from scanwright.firmware_io.assembly.assemble import assemble_recording
from scanwright.firmware_io.assembly.options import AssembleOptions
from scanwright.firmware_io.clouds.ply import read_ply

ROS = os.environ.get("SCANWRIGHT_ROS")
HERE = Path(__file__).parent
URDF = (HERE / "scanner.urdf").read_text()
LISTENER = str(HERE / "rebuild_cloud.py")
ANGLES = AngleSet(
    task="ros",
    angles_deg=Angles(alpha_rot=10, beta_rot=-30, alpha_laser=60, beta_laser=20),
    delta_rotvec_rot_deg=(0.3, -0.2),
    t_rot_laser_mm=(3, 4, 0),
    t_world_rot_mm=(1, 2, 130),
    sensor="URG-04LX",
    servo="MX-64R",
    motion={"mode": "spin", "period_s": 5.0},
)
pytestmark = pytest.mark.skipif(
    ROS is None, reason="SCANWRIGHT_ROS names no Python with rclpy and scanwright (CI makes one of the extra `ros`)"
)


def started(*words, domain, **more):
    """A process of the other Python, alone with those of this test."""
    env = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": str(domain)}
    return subprocess.Popen([ROS, *map(str, words)], env=env, text=True, **more)


@pytest.fixture
def domain():
    return 1 + os.getpid() % 99


def listening(domain, scans, out):
    listener = started(LISTENER, scans, out, domain=domain, stdout=subprocess.PIPE)
    assert listener.stdout.readline() == "listening\n"
    return listener


def ended(process, code=0):
    assert process.wait(BOUND_S) == code
    if process.stdout:
        process.stdout.close()


def test_somebody_elses_program_rebuilds_the_cloud_of_a_recording(tmp_path, domain):
    setup = Setup(beams=200, sweeps=((90.0, 180.0),), step_deg=360 / 4096)
    recording = write(tmp_path / "r.mcap", simulate(FURNISHED, setup, Truth()))
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    (tmp_path / "scanner.urdf").write_text(URDF)
    listener = listening(domain, 80, tmp_path / "found.npz")
    node = started("-m", "scanwright", "ros2", tmp_path, "--recording", recording, "--straight", domain=domain)
    ended(node)
    ended(listener)
    found = np.load(tmp_path / "found.npz")
    assert found["lines"] == 80
    assert np.isfinite(found["said"]).all()
    assert np.abs(found["said"] - found["rebuilt"]).max() < 1e-4
    assemble_recording(recording, ANGLES, tmp_path / "r.ply", AssembleOptions(smooth=False))
    rows = read_ply(tmp_path / "r.ply")
    np.testing.assert_array_equal(found["said"], np.stack([rows[axis] for axis in "xyz"], axis=1))


def test_turns_and_other_names_are_to_be_had(tmp_path, domain):
    """A message a turn, organised, under a name of the robot's; all of them are the cloud of the recording."""
    setup = Setup(beams=100, sweeps=((90.0, 180.0), (-90.0, 180.0)), step_deg=360 / 4096)
    recording = write(tmp_path / "r.mcap", simulate(FURNISHED, setup, Truth()))
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    whole = assemble_recording(
        recording, ANGLES, tmp_path / "r.ply", AssembleOptions(smooth=False, organised=True, per="turn")
    )
    names = ("--ros-args", "-r", "points:=front/cloud", "-r", "__ns:=/robot")
    collecting = started(
        HERE / "collect_points.py", 2, tmp_path / "f.npz", *names, domain=domain, stdout=subprocess.PIPE
    )
    assert collecting.stdout.readline() == "listening\n"
    words = ("ros2", tmp_path, "--recording", recording, "--straight", "--points-per", "turn")
    ended(started("-m", "scanwright", *words, "--", *names, domain=domain))
    ended(collecting)
    found = np.load(tmp_path / "f.npz")
    assert found["frames"].tolist() == ["world"] * len(whole.clouds)
    clouds = [found[f"cloud_{k}"] for k in range(len(whole.clouds))]
    assert {cloud.shape[1] for cloud in clouds} == {100}
    rows = np.concatenate([read_ply(path) for path in whole.clouds])
    said = np.concatenate([cloud.ravel() for cloud in clouds])
    for axis in "xyz":
        np.testing.assert_array_equal(said[axis], rows[axis])
    scan = rows["time_s"].reshape(-1, 100)
    assert np.concatenate([cloud["time"][:, 0] for cloud in clouds]).max() <= scan.max()


def test_points_of_a_turn_have_no_place_in_a_frame_that_turns(tmp_path, domain):
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    words = ("ros2", tmp_path, "--recording", tmp_path / "r.mcap", "--points-per", "turn", "--points-in", "rot")
    refused = started("-m", "scanwright", *words, domain=domain, stderr=subprocess.PIPE)
    assert "a frame that rotates cannot hold the points of a turn" in refused.communicate(timeout=BOUND_S)[1]
    assert refused.returncode == 2


def test_devices_are_published_and_a_listener_that_is_killed_is_not_missed(tmp_path, domain):
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    with subprocess.Popen(
        [sys.executable, "-m", "scanwright", "emulate", str(tmp_path)], stdout=subprocess.DEVNULL
    ) as emulators:
        try:
            until(lambda: (tmp_path / "emulated.json").exists() or emulators.poll() is not None)
            (tmp_path / "scanner.urdf").write_text(URDF)
            killed = listening(domain, 10**6, tmp_path / "none.npz")
            node = started("-m", "scanwright", "ros2", tmp_path, "--straight", domain=domain, stderr=subprocess.PIPE)
            seen = []
            until(lambda: seen.append(node.stderr.readline()) or "full scan" in seen[-1] or not seen[-1])
            killed.send_signal(signal.SIGKILL)
            ended(killed, -signal.SIGKILL)
            listener = listening(domain, 30, tmp_path / "found.npz")
            ended(listener)
            set_parameters = started(HERE / "set_parameters.py", domain=domain)
            ended(set_parameters)
            node.send_signal(signal.SIGINT)
            told = node.communicate(timeout=BOUND_S)[1]
            assert node.returncode == 130, told
            assert "stopped by a parameter" in told
        finally:
            emulators.terminate()
    found = np.load(tmp_path / "found.npz")
    assert found["lines"] >= 20  # of 30: who joins late has not heard all topics at first
    gaps_s = np.diff(found["stamp_ns"]) / 1e9
    assert np.median(gaps_s) < 0.15  # the scans of the sensor, ten a second; a busy computer drops some
    there = np.isfinite(found["said"])
    assert there.mean() > 0.5
    np.testing.assert_array_equal(there, np.isfinite(found["rebuilt"]))
    assert np.abs(found["said"] - found["rebuilt"])[there].max() < 1e-4

"""Scans in real time, by commands in processes of their own: each kind of lidar link, and scans that are ended."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from patience import until

from scanwright.design.angles import AngleSet
from scanwright.firmware_io.clouds.ply import read_ply
from scanwright.firmware_io.emulators.scanner import emulated_scanner
from scanwright.firmware_io.emulators.world import room
from scanwright.firmware_io.lidar.scip import dialogue
from scanwright.firmware_io.recording.repair.repair import repair
from scanwright.firmware_io.scan import lidar_scans

ROOT = Path(__file__).parents[3]


def angle_set(**more):
    angles = {"alpha_rot": 0, "beta_rot": -55, "alpha_laser": -80, "beta_laser": 75}
    motion = {"mode": "spin", "period_s": 2.0}
    values = {"task": "tour", "angles_deg": angles, "sensor": "UTM-30LX", "servo": "MX-64R", "motion": motion}
    return AngleSet.model_validate(values | more)


@pytest.fixture
def out(tmp_path):
    (tmp_path / "angles.json").write_text(angle_set().to_json())
    return tmp_path


@contextmanager
def program(*words):
    """A command in a process of its own, which is not left behind."""
    command = [sys.executable, "-m", "scanwright", *map(str, words)]
    # Without the COLUMNS that readline puts behind the back of os.environ: lines would be wrapped.
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "env": dict(os.environ)}
    with subprocess.Popen(command, cwd=ROOT, text=True, **pipes) as process:
        try:
            yield process
        finally:
            process.kill()


@contextmanager
def emulating(out, *words):
    """`scanwright emulate` while the body runs; it must end well, and leave nothing."""
    with program("emulate", out, *words) as process:
        until(lambda: (out / "emulated.json").exists() or process.poll() is not None)
        assert process.poll() is None, process.stderr.read()
        yield
        process.send_signal(signal.SIGTERM)
        _, complaints = process.communicate(timeout=300)
    complaints = [line for line in complaints.splitlines() if not line.startswith(("next: ", "  .. "))]
    assert (process.returncode, complaints) == (0, [])
    assert not (out / "emulated.json").exists()


def assert_it_shows_the_room(ply, least):
    """`least` is a fifth of the points, as a busy computer drops scans."""
    cloud = read_ply(ply)
    points_m = np.stack([cloud[axis] for axis in "xyz"], axis=1)
    points_m = points_m[np.isfinite(points_m).all(axis=1)]
    assert len(points_m) > least
    low_m, high_m = np.percentile(points_m, [1, 99], axis=0)
    np.testing.assert_allclose([low_m, high_m], [[-3.2, -2.4, -0.9], [4.0, 3.2, 1.9]], atol=0.15)


ATTEMPTS = 4


def scan_and_see_the_room(out, least, *words):
    """One good attempt suffices: on a busy computer the emulator sends late too, which no driver can know."""
    for attempt in range(1, ATTEMPTS + 1):
        with program("scan", out, "-o", out / "r.mcap", *words) as process:
            said, complaints = process.communicate(timeout=600)
        try:
            assert process.returncode == 0, complaints
            assert "timestamp uncertainty: " in said
            assert_it_shows_the_room(out / "r.ply", least)
            break
        except AssertionError:
            if attempt == ATTEMPTS:
                raise
        for made in ("r.mcap", "r.ply"):
            (out / made).unlink(missing_ok=True)


def test_a_scan_over_usb(out):
    with emulating(out, "--seed", 1):
        scan_and_see_the_room(out, 8_000)


@pytest.mark.parametrize(
    ("link", "devices", "least"),
    [("UART", {"sensor": "LD19", "servo": "STS3215"}, 2_000), ("Ethernet", {"sensor": "LMS111"}, 4_000)],
)
def test_a_scan_over_other_links(out, link, devices, least):
    angles = angle_set(**devices)
    (out / "angles.json").write_text(angles.to_json())
    with emulated_scanner(angles, room(None)) as emulators:
        lidar = emulators.lidar.address if link == "Ethernet" else emulators.ports.lidar
        scan_and_see_the_room(out, least, "--lidar", lidar, "--servo", emulators.ports.servo)


def stands(emulators):
    return abs(emulators.servo.axis.motion(time.monotonic_ns()).rate_rad_s) < 0.02


def recorded(out):
    (path,) = (out / "recordings").glob("*.mcap")
    return path


def grown(out):
    """Whether a recording has come to some seconds."""
    return any(path.stat().st_size > 200_000 for path in (out / "recordings").glob("*.mcap"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_scan_that_is_stopped_or_killed_leaves_the_servo_still_and_its_recording(out, emulators, number):
    words = ("--lidar", emulators.ports.lidar, "--servo", emulators.ports.servo, "--turns", 100)
    with program("scan", out, *words) as process:
        until(lambda: process.poll() is not None or grown(out))
        assert process.poll() is None, process.stderr.read()
        assert not stands(emulators)
        stopped_ns = time.time_ns()
        process.send_signal(number)
        _, complaints = process.communicate(timeout=300)
    until(lambda: stands(emulators))
    summary = repair(recorded(out))
    assert stopped_ns - summary.times_ns[1] < 10 * 10**9  # a second, and ten on a busy computer
    assert summary.intact == (number == signal.SIGINT)
    if number == signal.SIGINT:
        assert process.returncode == 130
        assert "servo 1 (MX-64R) has answered that its torque is off" in complaints


def test_a_servo_that_did_not_answer_is_not_said_to_stand(out, emulators):
    words = ("--lidar", emulators.ports.lidar, "--servo", emulators.ports.servo, "--turns", 100)
    with program("scan", out, *words) as process:
        until(lambda: process.poll() is not None or grown(out))
        assert process.poll() is None, process.stderr.read()
        emulators.servo.unplug()  # protocol 1.0 has no watchdog: it turns on
        process.send_signal(signal.SIGINT)
        _, complaints = process.communicate(timeout=300)
    assert process.returncode in (2, 130)  # whether the cut bus or Ctrl-C is noticed first is chance
    assert "could not be stopped: cut its power" in complaints
    assert "torque is off" not in complaints


def test_the_doctor_says_what_is_wrong_and_the_remedy(emulators, command, monkeypatch):
    monkeypatch.setattr(dialogue, "_REPLY_S", 0.1)
    monkeypatch.setattr("scanwright.firmware_io.device_ports.list_ports.comports", lambda: [])
    assert command("doctor")[0] == 1
    code, said, _ = command("doctor", "--lidar", emulators.ports.servo, "--servo", "no-such-port")
    assert code == 1
    wrong = [line for line in said.splitlines() if line.startswith("error")]
    assert len(wrong) == 2
    assert emulators.ports.servo in wrong[0]
    assert "no-such-port" in wrong[1]


def test_a_scanner_is_not_emulated_twice_nor_where_nothing_is_to_be_seen(out, command):
    (out / "emulated.json").write_text(json.dumps({"lidar": "L", "servo": "S", "pid": os.getpid()}))
    code, _, complaints = command("emulate", out)
    assert (code, len(complaints)) == (3, 1)
    assert f"process {os.getpid()} emulates this scanner already" in complaints[0]
    code, _, complaints = command("emulate", out, "--at", 500, 0, 0)
    assert code == 2
    assert "no surface within 30 m" in complaints[0]


@pytest.fixture
def emulators(monkeypatch):
    monkeypatch.setattr(lidar_scans, "_CLOCK_LEAST_S", 0.3)  # here nobody asks how exact the beams' times are
    with emulated_scanner(angle_set(), room(None)) as scanner:
        yield scanner

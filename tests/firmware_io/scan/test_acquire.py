"""From an angle set to a cloud, on the emulators: points lie on the room, and every exit is clean."""

import json
import math
import random
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from quick_tests import samples
from virtual_scanner import VirtualScanner

from scanwright.design.angles import AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError, DeviceFaultError, DeviceTimeoutError
from scanwright.design.motion import Spin, StopAndGo, Sweep
from scanwright.design.scene.ray_caster import cast
from scanwright.firmware_io.assembly.axis_curve import axis_curve
from scanwright.firmware_io.clouds.ply import read_ply
from scanwright.firmware_io.emulators.world import room
from scanwright.firmware_io.lidar.sick.scan_data import DIRT_WARNING
from scanwright.firmware_io.recording.recording import open_recording
from scanwright.firmware_io.recording.repair.repair import repair
from scanwright.firmware_io.samples import JointLog
from scanwright.firmware_io.scan import axis_thread, lidar_scans
from scanwright.firmware_io.scan.axis_thread import course
from scanwright.firmware_io.servo.progress import ServoState

SPIN = {"mode": "spin", "period_s": 2.0}


def angle_set(**more):
    angles = {"alpha_rot": 0, "beta_rot": -55, "alpha_laser": -80, "beta_laser": 75}
    values = {"task": "tour", "angles_deg": angles, "sensor": "UTM-30LX", "servo": "MX-64R", "motion": SPIN}
    return AngleSet.model_validate(values | more)


@pytest.fixture
def out(tmp_path):
    (tmp_path / "angles.json").write_text(angle_set().to_json())
    return tmp_path


@pytest.fixture(autouse=True)
def patience():
    """As long as devices are waited for: here nobody is late."""


# The course of the servo


@given(period_s=st.floats(1, 60), half_deg=st.floats(1, 80), from_deg=st.floats(-150, 150))
def test_a_sweep_is_ordered_from_limit_to_limit_each_half_period(period_s, half_deg, from_deg):
    motion = Sweep(limits_deg=(-half_deg, half_deg), period_s=period_s, accel_deg_s2=5000.0)
    begin_s, moves = course(motion, math.radians(from_deg))
    first, *rest = islice(moves, 7)
    assert first.at_s == 0
    assert begin_s >= abs(from_deg + half_deg) / motion.cruise_deg_s
    np.testing.assert_allclose([move.at_s - begin_s for move in rest], np.arange(6) * period_s / 2, atol=1e-9)
    goals_deg = np.degrees([move.goal_rad for move in [first, *rest]])
    np.testing.assert_allclose(goals_deg, half_deg * np.array([-1, 1, -1, 1, -1, 1, -1]))


@given(stops=st.integers(1, 40), dwell_s=st.floats(0.1, 5), move_s=st.floats(0.1, 2))
def test_stop_and_go_dwells_at_every_stop_in_the_time_of_one_scan(stops, dwell_s, move_s):
    motion = StopAndGo(stops=stops, dwell_s=dwell_s, move_s=move_s)
    begin_s, moves = course(motion, 0.0)
    first, *rest = islice(moves, stops)
    assert len({move.goal_rad for move in [first, *rest]}) == stops
    ends_s = [move.at_s - begin_s for move in rest] + [motion.duration_s - move_s]
    arrivals_s = [0.0] + [move.at_s - begin_s + move_s for move in rest]
    np.testing.assert_allclose(np.subtract(ends_s, arrivals_s), dwell_s)


def test_a_spin_is_one_order():
    begin_s, moves = course(Spin(period_s=2.0), 1.0)
    (move,) = moves
    assert (begin_s, move.goal_rad, move.rate_rad_s) == (0, math.inf, math.pi)


class Clock:
    """A clock that goes on only where somebody waits; an event that is set after a second."""

    def __init__(self):
        self.now_ns = 10**9
        self.rng = random.Random(1)

    def monotonic(self):
        return self.now_ns / 1e9

    def monotonic_ns(self):
        return self.now_ns

    def wait(self, seconds):
        self.now_ns += round(seconds * 1e9) + self.rng.randrange(200_000)  # the system's own lateness
        return self.now_ns > 2 * 10**9


class RoundingServo:
    """Turns evenly, from the moment it is made, by very nearly a whole step of its encoder in 10 ms."""

    step_rad = math.radians(300 / 1024)
    rate_rad_s = 1.04 * step_rad / 0.01

    def __init__(self, clock):
        self.clock, self.began_ns = clock, clock.now_ns

    def spin(self, rate_rad_s):
        pass

    def true_rad(self, time_ns):
        return self.rate_rad_s * (time_ns - self.began_ns) / 1e9

    def read(self):
        now_ns = self.clock.now_ns
        rounded_rad = self.step_rad * round(self.true_rad(now_ns) / self.step_rad)
        return ServoState(now_ns, 0, rounded_rad, self.rate_rad_s, 0.0, 12.0, 30.0)


def test_roundings_do_not_line_up_where_a_question_comes_with_every_step(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(axis_thread, "time", clock)
    monkeypatch.setattr(axis_thread, "random", random.Random(2))
    servo = RoundingServo(clock)
    axis = axis_thread.AxisThread(Spin(period_s=2 * math.pi / servo.rate_rad_s), 0.0, servo.step_rad)
    axis_thread._follow(servo, axis, clock)
    heard = axis.receive()
    assert len(heard) > 90
    time_ns = np.array([state.time_ns for state in heard])
    log = JointLog(time_ns, np.array([state.position_rad for state in heard]))
    error_rad = axis_curve(log, at_rest=False)[0].angle_at(time_ns) - servo.true_rad(time_ns)
    assert np.sqrt(np.mean(error_rad**2)) < 0.17 * servo.step_rad  # rounding alone is 0.29
    assert abs(np.diff(time_ns).mean() - 10e6) < 1e6


@pytest.mark.parametrize("stopped_s", [0.4, 1.0, 3.0])
def test_an_angle_is_left_out_if_this_process_was_stopped_while_it_was_asked_for(stopped_s):
    axis = axis_thread.AxisThread(Spin(period_s=6.0), 0.0, 0.0015)
    for k in range(100):
        axis.received.put(ServoState(k * 10_000_000, 500_000, 0.01 * k, 1.0, 0.0, 12.0, 30.0))
    half_ns = round(stopped_s / 2 * 1e9)
    axis.received.put(ServoState(10**9 + half_ns, half_ns, 1.0, 1.0, 0.0, 12.0, 30.0))  # it was read as the stop began
    assert len(axis.receive()) == 100
    assert dict(axis.left_out) == {"servo angles with uncertain timestamp": 1}


class ForgetfulServo(RoundingServo):
    """Does not hear the first orders of each kind."""

    def __init__(self, clock, deaf):
        super().__init__(clock)
        self.deaf, self.orders = deaf, []

    def sweep_to(self, goal_rad, _):
        self.orders.append(goal_rad)
        if self.deaf and len(self.orders) % 2:
            raise DeviceTimeoutError("no answer")


@pytest.mark.parametrize("deaf", [False, True])
def test_an_order_that_was_not_answered_is_given_again(monkeypatch, deaf):
    """Once: half a second without an answer ends a scan, the time of one on a busy computer does not."""
    clock = Clock()
    monkeypatch.setattr(axis_thread, "time", clock)
    servo = ForgetfulServo(clock, deaf)
    axis = axis_thread.AxisThread(Sweep(limits_deg=(-10, 10), period_s=1.0, accel_deg_s2=5000.0), 0.0, servo.step_rad)
    axis_thread._follow(servo, axis, clock)
    assert len(axis.receive()) > 90  # no error among them
    goals = [goal for index, goal in enumerate(servo.orders) if not deaf or index % 2]
    assert len(goals) >= 2 and goals == [math.radians(sign * 10) for sign in (-1, 1, -1, 1, -1)][: len(goals)]


# What can be refused before a device is touched

NO_MOTION = angle_set(motion=None)
BLIND = angle_set(servo="AX-12A")


@pytest.mark.parametrize(
    ("angles", "words", "says"),
    [
        (None, (), "angles.json"),
        (NO_MOTION, (), "motion = null"),
        (BLIND, (), "AX-12A measures its angle in 300 of 360 deg only"),
        (angle_set(), ("--turns", "0"), "turns = 0"),
        (angle_set(), (), "lidar: no port with a known USB id"),
        (angle_set(), ("--lidar", "x", "--servo", "y", "-o", "cloud.ply"), "name it cloud.mcap"),
        (angle_set(), ("--lidar", "x", "--servo", "y", "-o", "nowhere/r.mcap"), "nowhere does not exist"),
        (angle_set(), ("--lidar", "no-such-port", "--servo", "y"), "no-such-port"),
    ],
)
def test_what_cannot_be_scanned_is_one_line(tmp_path, command, monkeypatch, angles, words, says):
    monkeypatch.setattr("scanwright.firmware_io.device_ports.list_ports.comports", lambda: [])
    if angles is not None:
        (tmp_path / "angles.json").write_text(angles.to_json())
    code, _, complaints = command("scan", tmp_path, *words)
    assert code == (3 if "port" in says or "lidar" in says else 2)
    assert len(complaints) == 1
    assert says in complaints[0]
    assert not (tmp_path / "recordings").exists()


def test_a_dry_run_says_what_it_would_do_and_does_nothing(out, command):
    code, said, _ = command("scan", out, "--lidar", "L", "--servo", "S", "--turns", 3, "--dry-run")
    assert code == 0
    assert "lidar UTM-30LX at L" in said
    assert "3 x spin of 2 s: 6 s of recording" in said
    _, as_json, _ = command("scan", out, "--lidar", "L", "--servo", "S", "--turns", 3, "--dry-run", "--json")
    assert (json.loads(as_json)["duration_s"], json.loads(as_json)["recording"]) == (6, None)
    assert [path.name for path in out.iterdir()] == ["angles.json"]


# On emulated devices, by a clock that goes forward only where somebody waits


def residuals_m(cloud, angles, scene):
    """Range residuals of a cloud's points to the scene, along the beams; those near an edge are left out."""
    points_m = np.stack([cloud[axis] for axis in "xyz"], axis=1).astype(float)
    known = np.isfinite(points_m).all(axis=1)
    points_m, joint_rad = points_m[known], cloud["joint_rad"][known]
    origins_m = angles.T_world_laser(joint_rad)[:, :3, 3]
    range_m = np.linalg.norm(points_m - origins_m, axis=1)
    directions = (points_m - origins_m) / range_m[:, None]
    hits = cast(scene, origins_m, directions)
    normals = scene.normals[hits.triangle]
    across = np.cross(directions, [0.6, 0.0, 0.8])
    across /= np.linalg.norm(across, axis=1)[:, None]
    clear = np.full(len(points_m), True)
    for aside in (across, -across, np.cross(directions, across), np.cross(across, directions)):
        others = directions + math.radians(0.5) * aside
        near = cast(scene, origins_m, others)
        there = origins_m + near.range_m[:, None] * others
        here = origins_m + hits.range_m[:, None] * directions
        clear &= np.abs(np.einsum("ij,ij->i", there - here, normals)) < 1e-6  # still on the same plane
    return (range_m - hits.range_m)[clear], hits.range_m[clear], clear.mean()


SWEEP = {"mode": "sweep", "limits_deg": [-45, 45], "period_s": 6.0}  # at 30.6 deg/s, 1.05 steps of 0.293 deg in 10 ms
SICK = {"sensor": "LMS111"}
INTERLACED = {"sensor": "LMS 200"}  # scans of 181 and of 180 beams in turn
SWEEPING = {"sensor": "URG-04LX", "servo": "AX-12A", "motion": SWEEP}


CHEAP = {"sensor": "LD19", "servo": "STS3215"}  # a turn of beams of its own each
CAPSULES = {"sensor": "RPLIDAR S1"}
SCANNERS = [  # every family of lidars and of servos
    (SWEEPING, 1, 15_000),
    (CHEAP, 2, 12_000),
    (CAPSULES, 2, 12_000),
    (SICK, 2, 40_000),
    (INTERLACED, 1, 15_000),
    ({}, 1, 40_000),
]


@pytest.fixture
def virtual(monkeypatch, out):
    """Makes the devices of an angle set, and the clock."""

    def make(angle_rad=0.0, **more):
        angles = angle_set(**more)
        (out / "angles.json").write_text(angles.to_json())
        return VirtualScanner(angles, seed=1, angle_rad=angle_rad).install(monkeypatch)

    return make


@pytest.fixture
def scanner(virtual, monkeypatch):
    monkeypatch.setattr(lidar_scans, "_CLOCK_LEAST_S", 0.3)  # here nobody asks how exact the beams' times are
    return virtual()


@pytest.mark.parametrize(("devices", "turns", "points"), samples(SCANNERS, SCANNERS[:5]))
def test_a_scan_of_the_room_lies_on_the_room(out, command, virtual, devices, turns, points):
    virtual(**devices)
    angles = angle_set(**devices)
    code, said, complaints = command(
        "scan", out, "--lidar", "L", "--servo", "S", "--turns", turns, "-o", out / "r.mcap"
    )
    assert code == 0, complaints
    lidar = load_catalogue().get(angles.sensor, Lidar)
    error_m, range_m, share = residuals_m(read_ply(out / "r.ply"), angles, room(None))
    sigmas = error_m / np.hypot(lidar.sigma_mm(1000 * range_m) / 1000, 0.001 / math.sqrt(12))
    assert sigmas.size > points
    assert share > 0.8
    spread = np.median(np.abs(sigmas - np.median(sigmas))) / 0.67449  # 1 for a normal distribution
    assert abs(spread - 1) < max(0.02, 4 * 1.17 / np.sqrt(sigmas.size))  # four standard errors
    assert abs(np.median(sigmas)) < 0.05
    assert np.abs(sigmas).max() < 6
    assert "timestamp uncertainty: " in said


def recorded(out):
    (path,) = (out / "recordings").glob("*.mcap")
    return path


FATAL = {
    "stall": (lambda scanner: scanner.servo.servo.axis.change(scanner.clock.now_ns, blocked=True), DeviceFaultError),
    "servo unplugged": (lambda scanner: scanner.servo.unplug(), DeviceError),
    "servo brown-out": (lambda scanner: scanner.servo.servo.restart(scanner.clock.now_ns), DeviceError),
    "overload": (lambda scanner: scanner.servo.servo.overload(scanner.clock.now_ns), DeviceFaultError),
    "lidar unplugged for good": (lambda scanner: scanner.lidar.unplug(), DeviceError),
}


@pytest.mark.parametrize("fault", FATAL)
def test_a_fault_stops_the_servo_and_keeps_the_recording(out, scanner, fault):
    happens, kind = FATAL[fault]
    with pytest.raises(kind) as caught:
        scanner.scan(out, ("recording", lambda: happens(scanner)), turns=5)
    assert "\n" not in str(caught.value)
    if fault != "servo unplugged":  # then nobody can tell it, protocol 1.0 has no watchdog
        scanner.clock.sleep(1.0)
        assert scanner.stands()
    assert repair(recorded(out)).intact


def garble(scanner):
    def flip(packet):
        return packet[:40] + bytes([packet[40] ^ 8]) + packet[41:]

    scanner.lidar.damage.extend([flip] * 3 + [lambda packet: packet[: len(packet) // 2]] * 3)


HARMLESS = {
    "lidar brown-out": lambda scanner: scanner.lidar.machine.power_cycle(scanner.clock.now_ns),
    "garbage": garble,
    "bit errors of the servo": lambda scanner: setattr(scanner.servo, "bit_error_rate", 1e-3),
}


@pytest.mark.parametrize("fault", HARMLESS)
def test_what_can_be_mended_is_mended(out, scanner, fault):
    summary = scanner.scan(out, ("recording", lambda: HARMLESS[fault](scanner)))
    assert summary.reconnects >= fault.startswith("lidar")
    assert (summary.left_out.get("bad packets", 0) >= 3) == (fault == "garbage")
    recording = open_recording(recorded(out))
    assert recording.joint_log.position_rad[-1] - recording.joint_log.position_rad[0] > 2 * math.pi
    assert summary.scans == recording.beams.size > 20


def test_the_servo_stands_while_the_lidar_is_away_and_that_turn_is_taken_again(out, scanner):
    clock, plugged_ns = scanner.clock, []

    def plug_again():
        assert scanner.stands()
        plugged_ns.append(clock.time_ns())
        scanner.lidar.plugged = True

    def pull():
        scanner.lidar.unplug()
        scanner.at(3.0, plug_again)

    # progress is told each second: in the middle of the first of two turns
    summary = scanner.scan(out, ("running", pull), turns=2)
    assert summary.reconnects == 1
    assert abs(summary.speed_deg_s - 180) < 4
    recording = open_recording(recorded(out))
    after_ns = recording.stamp_ns[recording.stamp_ns > plugged_ns[0]]
    before = recording.stamp_ns.size - after_ns.size
    assert before > 20
    assert after_ns[0] - plugged_ns[0] < 3 * 10**9
    first_rad, last_rad = recording.joint_log.angle_at(after_ns[[0, -1]])
    assert 4 * math.pi < last_rad - first_rad < 4.6 * math.pi
    steps_rad = np.diff(recording.joint_log.angle_at(after_ns))
    due_rad = math.pi * np.diff(after_ns) / 1e9
    assert np.abs(steps_rad - due_rad).max() < math.radians(1)  # none while it came up to speed


def test_only_scans_at_rest_are_taken_at_stops(out, virtual):
    scanner = virtual(motion={"mode": "stop_and_go", "stops": 4, "dwell_s": 0.3, "move_s": 0.5})
    summary = scanner.scan(out)
    recording = open_recording(recorded(out))
    assert summary.left_out["scans between two stops"] > 10
    assert recording.at_rest
    for scan in recording.scans():
        assert np.ptp(recording.joint_log.angle_at(scan.time_ns)) < math.radians(0.2)


def test_another_lidar_than_the_angle_set_says_is_refused(out, scanner):
    (out / "angles.json").write_text(angle_set(sensor="URG-04LX").to_json())
    with pytest.raises(DeviceError, match="this is a UTM-30LX, but the angle set is for a URG-04LX"):
        scanner.scan(out)


def test_the_doctor_finds_healthy_devices_healthy(out, virtual, command):
    virtual()
    code, said, _ = command("doctor", out, "--lidar", "L", "--servo", "S")
    assert code == 0, said
    assert "UTM-30LX, serial number 00903971, firmware P.1.05" in said
    assert "(nominal 40.0)" in said
    assert "protocol 1.0 at 57600 baud" in said
    assert "error" not in said


def test_scan_and_doctor_report_a_dirty_window(out, virtual, command, caplog):
    scanner = virtual(**SICK)
    scanner.lidar.machine.status = DIRT_WARNING
    scanner.scan(out)
    received = "LMS111: its window is dirty, but it still measures: clean it"
    assert [line for line in caplog.messages if "dirty" in line] == [received]
    code, lines, _ = command("doctor", out, "--lidar", "L", "--servo", "S")
    assert code == 1
    assert "LMS111, serial number 18030000, firmware V1.00" in lines
    assert "(nominal 50.0)" in lines
    (error,) = [line for line in lines.splitlines() if line.startswith("error")]
    assert "its window is dirty" in error


def test_a_servo_in_its_dead_sector_is_not_moved(out, virtual):
    motion = {"mode": "sweep", "limits_deg": [-60, 60], "period_s": 4.0}
    scanner = virtual(math.radians(170), servo="AX-12A", motion=motion)
    with pytest.raises(DeviceError, match="is in its dead sector"):
        scanner.scan(out)


def test_clusters_and_every_second_scan_reach_the_recording(out, scanner):
    summary = scanner.scan(out, cluster=5, every=2)
    scans = list(open_recording(recorded(out)).scans())
    assert summary.scans == len(scans)
    assert {scan.range_m.size for scan in scans} == {217}
    steps_s = np.diff([scan.stamp_ns for scan in scans]) / 1e9
    assert np.median(steps_s) == pytest.approx(0.05, rel=0.02)


@pytest.mark.parametrize(
    ("motion", "period_s", "says"),
    [
        (SWEEP, 9.5, ""),
        (SPIN, 9.5, ""),
        (SWEEP, 0.1, "error: --period-s = 0.1: 90 deg out and back at accel_deg_s2 = 720 take 1.41 s at least"),
        (SPIN, -3, "error: --period-s = -3: Input should be greater than or equal to 0.001"),
        (
            {"mode": "stop_and_go", "stops": 4, "dwell_s": 0.5},
            9.5,
            "error: --period-s = 9.5: a stop_and_go motion has none",
        ),
    ],
)
def test_a_scan_can_have_another_period_than_the_task(tmp_path, command, motion, period_s, says):
    (tmp_path / "angles.json").write_text(angle_set(motion=motion).to_json())
    words = ("--lidar", "L", "--servo", "S", "--dry-run", "--period-s", period_s)
    code, said, complaints = command("scan", tmp_path, *words)
    assert code == (2 if says else 0)
    assert complaints[0].startswith(says) if says else f" of {period_s} s: {period_s} s of recording" in said

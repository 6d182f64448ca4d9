"""Fault drills: whatever fails, the scan says the truth about the servo, what to do, and keeps every complete scan."""

import errno
import math
import os
from types import SimpleNamespace

import numpy as np
import pytest
from quick_tests import samples
from virtual_scanner import VirtualScanner

from scanwright.design.angles import AngleSet
from scanwright.firmware_io.recording.recording import open_recording
from scanwright.firmware_io.recording.repair.repair import repair
from scanwright.firmware_io.scan import acquire, lidar_scans, recorder

SCAN_S = {"UTM-30LX": 0.025, "LD19": 0.1}
SERVOS = ("MX-64R", "XM430-W350", "STS3215")
STOPPED = list(zip(SERVOS, ("LD19", "UTM-30LX", "LD19"), strict=True))
OFF = "has answered that its torque is off"
UNKNOWN = "could not be stopped: cut its power"


@pytest.fixture(autouse=True)
def patience():
    """As long as devices are waited for: here nobody is late."""


class Drill:
    """A scan of 8 s by the command, and something that happens to it."""

    def __init__(self, out, command, monkeypatch, servo, lidar):
        values = {"task": "drill", "sensor": lidar, "servo": servo, "motion": {"mode": "spin", "period_s": 8.0}}
        angles = {"alpha_rot": 0, "beta_rot": -55, "alpha_laser": -80, "beta_laser": 75}
        angles = AngleSet.model_validate(values | {"angles_deg": angles})
        (out / "angles.json").write_text(angles.to_json())
        self.out, self.file, self._command, self._scan_s = out, out / "r.mcap", command, SCAN_S[lidar]
        self.scanner = VirtualScanner(angles).install(monkeypatch)
        self.clock, self.servo, self.lidar = self.scanner.clock, self.scanner.servo, self.scanner.lidar
        self._watch_recording(monkeypatch)

    def _watch_recording(self, monkeypatch):
        """Something happens some seconds into the recording; times on the clock of the recording are kept."""
        self.due, made = [], acquire.recorder_of

        def recording(*words):
            for seconds, happens in self.due:
                self.scanner.at(seconds, happens)
            self.wall_ns = self.clock.wall_minus_monotonic_ns
            return made(*words)

        monkeypatch.setattr(acquire, "recorder_of", recording)

    def happens(self, seconds, happens):
        def noted():
            self.fault_ns = self.clock.now_ns + self.wall_ns
            happens()

        self.due.append((seconds, noted))

    def run(self):
        code, self.said, complaints = self._command("scan", self.out, "--lidar", "L", "--servo", "S", "-o", self.file)
        self.told = "\n".join(complaints)
        return code

    def torque(self):
        return bool(self.servo.memory[self.servo.servo.table.torque.address])

    def kept_until_ns(self):
        """The last beam on the disk."""
        summary = repair(self.file)
        assert summary.intact
        scans = list(open_recording(self.file).scans())
        assert np.all(np.diff([scan.stamp_ns for scan in scans]) > 0)
        return scans[-1].time_ns[-1]

    def assert_all_is_kept(self):
        """Every scan that was complete when it failed: the next one, and the angle after it, were not."""
        assert self.fault_ns - self.kept_until_ns() < 1.3 * self._scan_s * 1e9


@pytest.fixture
def drill(tmp_path, command, monkeypatch):
    monkeypatch.setattr(lidar_scans, "_CLOCK_LEAST_S", 0.3)  # no test here needs exact beam times
    return lambda servo="MX-64R", lidar="LD19": Drill(tmp_path, command, monkeypatch, servo, lidar)


@pytest.mark.parametrize("lidar", SCAN_S)
def test_the_lidar_is_pulled(drill, lidar):
    one = drill(lidar=lidar)
    one.happens(3.0, one.lidar.unplug)
    assert one.run() == 3
    assert "did not come back in 10.0 s; check its plug" in one.told
    assert OFF in one.told and not one.torque() and one.scanner.stands()
    one.assert_all_is_kept()


@pytest.mark.parametrize("lidar", SCAN_S)
def test_the_lidar_is_pulled_and_put_back(drill, lidar):
    one = drill(lidar=lidar)
    one.happens(3.0, one.lidar.unplug)
    one.due.append((5.0, lambda: setattr(one.lidar, "plugged", True)))
    assert one.run() == 0
    assert "the servo has answered that it holds, waiting 10 s for the lidar to come back" in one.told
    assert "lidar reconnects: 1" in one.said and not one.torque()


@pytest.mark.parametrize("servo", samples(SERVOS, ("MX-64R", "XM430-W350")))
def test_the_adapter_of_the_servo_is_pulled(drill, servo):
    one = drill(servo)
    one.happens(3.0, one.servo.unplug)
    assert one.run() == 3
    assert "the port is gone" in one.told and UNKNOWN in one.told and OFF not in one.told
    one.assert_all_is_kept()
    one.clock.sleep(3.0)
    one.servo.serve(b"", one.clock.now_ns)
    one.clock.sleep(1.0)
    assert one.scanner.stands() == (servo == "XM430-W350")  # which has a watchdog


@pytest.mark.parametrize("servo", samples(SERVOS, ("STS3215",)))
def test_the_cable_of_the_servo_is_pulled_and_put_back(drill, servo):
    one = drill(servo)
    one.happens(3.0, lambda: setattr(one.servo, "cut", True))
    one.due.append((4.5, lambda: setattr(one.servo, "cut", False)))
    assert one.run() == 3
    assert "no answer" in one.told and OFF in one.told and UNKNOWN not in one.told
    one.clock.sleep(1.0)
    assert not one.torque() and one.scanner.stands()
    one.assert_all_is_kept()


def test_a_short_loss_of_the_servo_costs_angles_and_is_counted(drill):
    one = drill()
    one.happens(3.0, lambda: setattr(one.servo, "cut", True))
    one.due.append((3.1, lambda: setattr(one.servo, "cut", False)))
    assert one.run() == 0
    assert "lost servo replies: " in one.said and "longest gap between angles: 0.2" in one.said


@pytest.mark.parametrize("servo", samples(SERVOS, ("MX-64R",)))
def test_the_bus_is_shorted(drill, servo):
    one = drill(servo)
    one.happens(3.0, lambda: setattr(one.servo, "shorted", True))
    assert one.run() == 3
    assert UNKNOWN in one.told and OFF not in one.told
    one.assert_all_is_kept()


@pytest.mark.parametrize("servo", SERVOS)
def test_a_dip_of_the_supply_restarts_the_servo(drill, servo):
    """Its torque is off then, and what does not outlast the power is lost."""
    one = drill(servo)
    one.happens(3.0, lambda: one.servo.servo.restart(one.clock.now_ns))
    assert one.run() == 3
    assert OFF in one.told and not one.torque()
    assert "restarted by itself" in one.told or "no answer" in one.told
    assert "check its" in one.told
    one.assert_all_is_kept()


@pytest.mark.parametrize(("servo", "lidar"), samples(STOPPED, STOPPED[:2]))
def test_the_process_is_stopped_for_ten_seconds(drill, servo, lidar):
    one = drill(servo, lidar)
    one.happens(3.0, lambda: one.clock.stop_all(10.0))
    assert one.run() == 3
    assert "not read for 2 s while it turned, so it was stopped" in one.told
    assert not one.torque() and one.scanner.stands()
    one.assert_all_is_kept()


def test_the_wall_clock_is_set_back(drill):
    """Times of a recording stay even, on the wall clock of its start."""
    one = drill(lidar="UTM-30LX")

    def set_it():
        one.clock.wall_minus_monotonic_ns -= 3600 * 10**9

    one.happens(3.0, set_it)
    assert one.run() == 0
    recording = open_recording(one.file)
    assert np.abs(np.diff(recording.stamp_ns) - 25e6).max() < 1e6
    turned_rad = np.diff(recording.joint_log.angle_at(recording.stamp_ns[[0, -1]]))
    assert turned_rad == pytest.approx(2 * math.pi, rel=0.02)


def test_the_disk_is_full(drill, monkeypatch):
    one = drill()
    full = []

    def write(descriptor, data):
        if full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return os.write(descriptor, data)

    fake = SimpleNamespace(**{name: getattr(os, name) for name in ("open", "close", "ftruncate")})
    fake.fsync = lambda _: None  # a slow disk of this computer is no part of the drill
    fake.O_WRONLY, fake.O_CREAT, fake.O_EXCL, fake.write = os.O_WRONLY, os.O_CREAT, os.O_EXCL, write
    monkeypatch.setattr(recorder, "os", fake)
    monkeypatch.setattr(recorder, "CHUNK_S", 0.01)  # the recorder's thread runs in real time, the rest does not
    one.happens(3.0, lambda: full.append(True))
    assert one.run() == 3
    assert "No space left on device; earlier data are on the disk: free space, then `scanwright repair" in one.told
    assert OFF in one.told and not one.torque()
    full.clear()
    summary = repair(one.file)
    assert one.fault_ns - summary.times_ns[1] < 1e9

"""A scan whose lidar fails, one lidar of each family, by a clock that goes forward only where somebody waits."""

from types import SimpleNamespace

import numpy as np
import pytest
from virtual_line import VirtualLine
from virtual_time import replace_time

from scanwright.design.errors import DeviceError, DeviceFaultError
from scanwright.firmware_io.lidar import sensor_line
from scanwright.firmware_io.lidar.families import FAMILIES, family_of, open_lidar
from scanwright.firmware_io.lidar.scip import driver as scip
from scanwright.firmware_io.lidar.sick.scan_data import DIRT_WARNING, FAULT
from scanwright.firmware_io.scan import doctor, lidar_scans
from scanwright.firmware_io.scan.live_feed import Reporter

MODELS = ("UTM-30LX", "STL27L", "RPLIDAR A2", "RPLIDAR C1", "RPLIDAR S2", "TiM561", "LMS 200")
MOST_LOST_S = 1.0


@pytest.fixture(autouse=True)
def patience():
    """As long as devices are waited for: here nobody is late."""


def wall(_time_ns, bearing_rad):
    return 2.0 + np.sin(bearing_rad), np.full(bearing_rad.size, 800.0)


class Scanner:
    """A lidar that scans, and what became of the servo."""

    def __init__(self, line, lidar):
        self.line, self.lidar, self.said, self.axis = line, lidar, [], []
        self.scans = lidar_scans.LidarScans(lidar, Reporter(watch=SimpleNamespace(message=self.said.append)))
        self.scans.axis = SimpleNamespace(stop=lambda: not self.axis.append("stop"), go=lambda: self.axis.append("go"))

    def next(self):
        scan = self.scans.next()
        seen = np.isfinite(scan.range_m)
        if self.lidar.model != "RPLIDAR C1":  # whose two check bits let a flipped range through
            rounded_m = 5e-3 if self.lidar.model == "RPLIDAR A2" else 2e-3  # in steps of 4 mm
            np.testing.assert_allclose(scan.range_m[seen], 2.0 + np.sin(scan.bearing_rad[seen]), atol=rounded_m)
        assert seen.mean() > 0.9
        return scan


@pytest.fixture(params=MODELS)
def line(request, monkeypatch):
    line = VirtualLine(request.param, wall)
    line.machine.baud = 500_000  # of those that have a speed: no such line here
    replace_time(line, monkeypatch, "scanwright.firmware_io.lidar", "scanwright.firmware_io.scan")
    monkeypatch.setattr(sensor_line, "open_stream", line.open)
    monkeypatch.setattr(scip, "lidar_ports", list)
    return line


@pytest.fixture
def scanner(line):
    with open_lidar("virtual", line.model) as lidar:
        lidar.start()
        made = Scanner(line, lidar)
        for _ in range(6):
            made.next()
        yield made


def test_every_family_is_here():
    assert {family_of(model).name for model in MODELS} == {family.name for family in FAMILIES}


def test_damaged_packets_cost_their_turns_and_no_more(scanner):
    def flip(packet):
        return packet[:40] + bytes([packet[40] ^ 8]) + packet[41:] if len(packet) > 40 else packet[:-1]

    scanner.line.damage.extend([flip, lambda packet: packet[: len(packet) // 2], lambda packet: b"\x54\xa5" + packet])
    before_ns = scanner.line.now_ns
    scans = [scanner.next() for _ in range(10)]
    assert scanner.lidar.bad_packets >= 1
    usual_ns = 10e9 / scanner.lidar.scan_rate_hz
    assert scans[-1].time_ns[-1] - before_ns < usual_ns + MOST_LOST_S * 1e9
    assert scanner.axis == [] and scanner.said == []


def test_after_a_brown_out_the_servo_stands_until_it_scans_again(scanner):
    scanner.line.machine.power_cycle(scanner.line.now_ns)
    scanner.line.machine.baud = 500_000
    before_ns = scanner.line.now_ns
    for _ in range(5):
        scan = scanner.next()
    assert scanner.axis == ["stop", "go"] and scanner.scans.away == 1
    assert "the servo has answered that it holds" in scanner.said[0]
    assert before_ns < scan.stamp_ns < scanner.line.now_ns
    assert scanner.line.now_ns - before_ns < 3e9  # one of which it is missed, one it starts


def test_unplugged_and_back_it_scans_on(scanner, monkeypatch):
    scanner.line.unplug()
    pulled_ns, sleep = scanner.line.now_ns, scanner.line.sleep

    def until_plugged(seconds):
        sleep(seconds)
        scanner.line.plugged |= scanner.line.now_ns > pulled_ns + 500_000_000

    monkeypatch.setattr(scanner.line, "sleep", until_plugged)
    scanner.next()
    assert scanner.axis == ["stop", "go"]
    assert scanner.line.now_ns - pulled_ns < (0.5 + MOST_LOST_S + 2.0) * 1e9


def test_one_that_stays_away_is_a_typed_error_of_one_line(scanner):
    scanner.line.unplug()
    pulled_ns = scanner.line.now_ns
    with pytest.raises(DeviceError, match=r"did not come back in 10\.0 s") as received:
        scanner.next()
    assert "\n" not in str(received.value) and not isinstance(received.value, DeviceFaultError)
    assert scanner.axis == ["stop"]
    assert scanner.line.now_ns - pulled_ns < 11e9
    scanner.line.plugged = True  # so that leaving it is no error


def test_noise_without_end_is_a_timeout(scanner, monkeypatch):
    with monkeypatch.context() as noise:
        noise.setattr(scanner.line, "read", lambda _: scanner.line.sleep(0.01) or b"\x00\xff\x54\xa5\x02" * 8)
        noise.setattr(lidar_scans, "_AWAY_S", 1.0)
        with pytest.raises(DeviceError, match=r"did not come back in 1\.0 s"):
            scanner.next()


@pytest.mark.parametrize(
    ("line", "state", "value", "says"),
    [
        ("RPLIDAR A2", "health", 1, "health warning 0x8002"),
        ("UTM-30LX", "state", "Trouble!! Error No. 00->33", "status: Trouble!! Error No. 00->33"),
        ("TiM561", "status", DIRT_WARNING, "its window is dirty"),
        ("LMS 200", "status", 0x90, "its window is dirty"),
    ],
    indirect=["line"],
)
def test_what_a_sensor_warns_of_is_told_once_by_a_scan_and_is_no_good_finding_of_the_doctor(line, state, value, says):
    setattr(line.machine, state, value)
    with open_lidar("virtual", line.model) as lidar:
        lidar.start()
        scanner = Scanner(line, lidar)
        for _ in range(8):
            scanner.next()
    (said,) = scanner.said
    assert said.startswith(f"warning: {line.model}: {says}")
    findings = list(doctor._examine_lidar("virtual", SimpleNamespace(sensor=line.model)))
    assert [finding.severity for finding in findings if says in finding.message] == ["error"]


@pytest.mark.parametrize(
    ("line", "state", "value"),
    [("RPLIDAR A2", "health", 2), ("TiM561", "status", FAULT), ("LMS 200", "status", 0x13)],
    indirect=["line"],
)
def test_a_sensor_that_reports_a_fault_is_a_typed_error_before_a_servo_turns_and_at_once(line, state, value):
    setattr(line.machine, state, value)
    said, began_ns = [], line.now_ns
    with open_lidar("virtual", line.model) as lidar, pytest.raises(DeviceFaultError, match="fault"):
        lidar.start()
        reporter = Reporter(lambda step, _=None: said.append(step))
        lidar_scans.settle_clock(lidar_scans.LidarScans(lidar, reporter), reporter)
    assert line.now_ns - began_ns < MOST_LOST_S * 1e9
    assert said in ([], ["estimating the sensor's clock"])


@pytest.mark.parametrize(
    ("line", "state", "value"), [("TiM561", "status", FAULT), ("LMS 200", "status", 0x13)], indirect=["line"]
)
def test_a_fault_in_the_midst_of_a_scan_is_told_within_the_turns_that_were_under_way(scanner, state, value):
    setattr(scanner.line.machine, state, value)
    began_ns = scanner.line.now_ns
    with pytest.raises(DeviceFaultError, match="fault"):
        for _ in range(5):
            scanner.next()
    assert scanner.line.now_ns - began_ns < 5e9 / scanner.lidar.scan_rate_hz
    assert scanner.axis == []  # what ends the scan ends the motion, too


class LoosePlug:
    """A lidar that is lost at each second read and comes back at once."""

    model = "loose"

    def __init__(self):
        self.reads = self.reconnects = 0

    def read(self):
        self.reads += 1
        if self.reads % 2:
            raise DeviceError("gone")
        return SimpleNamespace(scan=self.reads, uncertainty_ns=0, warning="")

    def reconnect(self, _timeout_s):
        self.reconnects += 1


@pytest.mark.parametrize(("every_s", "most"), [(1.0, 9), (70.0, 30)])
def test_one_that_is_lost_again_and_again_ends_the_scan(monkeypatch, every_s, most):
    now_s = iter(every_s * number for number in range(1000))
    monkeypatch.setattr(lidar_scans, "time", SimpleNamespace(monotonic=lambda: next(now_s)))
    lidar = LoosePlug()
    scans = lidar_scans.LidarScans(lidar, Reporter())
    if most == 9:
        with pytest.raises(DeviceError, match="gone; lost 10 times in"):
            for _ in range(30):
                scans.next()
        assert lidar.reconnects == most
    else:
        for _ in range(most):
            scans.next()

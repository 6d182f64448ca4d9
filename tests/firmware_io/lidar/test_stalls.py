"""A reader that is held up: beams of sensors without a clock of their own are on time, or dropped and counted."""

from collections import deque

import numpy as np
import pytest
import virtual_line
from virtual_line import VirtualLine

from design.errors import DeviceTimeoutError
from firmware_io.lidar import sensor_line
from firmware_io.lidar.families import open_lidar
from firmware_io.lidar.ldrobot import driver as ldrobot
from firmware_io.lidar.lms2xx import driver as lms2xx
from firmware_io.lidar.slamtec import dialogue, protocol
from firmware_io.lidar.slamtec import driver as slamtec
from firmware_io.lidar.slamtec.point_count import PointCount

MODELS = ["LD06", "LD19", "STL27L", "LMS 200"]
MODELS += [f"RPLIDAR {series}" for series in ("A1", "A2", "A3", "S1", "S2", "C1")]
CYCLE_S = 4.0
ROUNDED_MS = 0.5  # by which a range in millimetres tells the time
STALLS = 5


def at_its_time(time_ns, bearing_rad):
    """A range tells when it was measured."""
    return 1.0 + 1.5e-9 * (time_ns % round(CYCLE_S * 1e9)), np.full(len(bearing_rad), 200.0)


def off_ms(scan):
    """By how much the times of the beams are wrong."""
    told_s = (scan.range_m.astype(float) - 1.0) / 1.5
    return ((scan.time_ns / 1e9 - told_s + CYCLE_S / 2) % CYCLE_S - CYCLE_S / 2) * 1e3


class HeldUpLine(VirtualLine):
    """A line whose reader is held up at times, inside of a read or between two.

    What comes meanwhile waits in a buffer as long as that has room; what finds it full is lost, as behind a kernel that
    throttles its adapter.
    """

    def __init__(self, model, stalls, buffer_bytes):
        super().__init__(model, at_its_time)
        self.stalls = deque((self.now_ns + round(at_s * 1e9), round(length_s * 1e9)) for at_s, length_s in stalls)
        self.buffer_bytes = buffer_bytes

    def read(self, timeout_s):
        if self._is_held_up():
            return b""
        data = super().read(timeout_s)
        if not data and self._is_held_up():
            return super().read(0.0)
        return data

    def _is_held_up(self):
        if not self.stalls or self.now_ns < self.stalls[0][0]:
            return False
        self.now_ns += self.stalls.popleft()[1]
        waiting = sum(len(data) for _, data in self._coming)
        while waiting < self.buffer_bytes and self.machine.next_ns() <= self.now_ns:
            for sent_ns, data in self.machine.next_packets():
                if waiting + len(data) <= self.buffer_bytes:
                    self._coming.append((sent_ns, data))
                    waiting += len(data)
        self.machine.leave_out(self.now_ns)
        return True


def opened(monkeypatch, model, stalls, buffer_bytes):
    line = HeldUpLine(model, stalls, buffer_bytes)
    if model.startswith("LMS"):
        line.machine.baud = 500_000
    monkeypatch.setattr(virtual_line, "_BUFFER_NS", 1 << 60)
    for module in (sensor_line, dialogue, slamtec, ldrobot, lms2xx):
        monkeypatch.setattr(module, "time", line)
    monkeypatch.setattr(sensor_line, "open_stream", line.open)
    return line, open_lidar("virtual", model)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("buffer_bytes", [4095, 69_631])  # a pseudo-terminal's; a serial port's with all it can hold
def test_beams_are_on_time_or_dropped_and_counted(monkeypatch, model, buffer_bytes):
    rng = np.random.default_rng([19, MODELS.index(model)])
    lengths_s = np.exp(rng.uniform(np.log(0.05), np.log(10.0), STALLS))
    stalls = list(zip(0.5 + np.cumsum(lengths_s + rng.uniform(0.3, 0.9, STALLS)) - lengths_s, lengths_s, strict=True))
    line, lidar = opened(monkeypatch, model, stalls, buffer_bytes)
    with lidar:
        lidar.start()
        timed = []
        while line.stalls or len(timed) < 10:
            timed.append(lidar.read())
        timed += [lidar.read() for _ in range(5)]
        turn_ns = 1e9 / lidar.scan_rate_hz
        stamps_ns = np.array([one.scan.stamp_ns for one in timed])
        missing = np.round((np.diff(stamps_ns) - turn_ns) / turn_ns).sum()
        assert lidar.bad_packets == 0
        assert abs(lidar.dropped - missing) <= STALLS  # the motor is not quite as fast as the catalogue says
    assert np.diff(stamps_ns).min() > 0.5 * turn_ns
    for one in timed:
        assert np.nanmax(np.abs(off_ms(one.scan))) < 3e-6 * one.uncertainty_ns + ROUNDED_MS


class EndlessPort:
    """A port that always has something to read."""

    def read(self, _):
        return b"\x54" * 4095


def test_a_port_that_never_runs_empty_is_given_up(monkeypatch):
    monkeypatch.setattr(sensor_line, "open_stream", lambda _: EndlessPort())
    with pytest.raises(DeviceTimeoutError, match="it sends faster than this computer reads"):
        sensor_line.SensorLine("wire", 100).drop_waiting()


CAPSULE_NS = 32 * 62_500  # of 32 points, 62.5 us each


def capsules(count, start_deg):
    """Capsules of a motor, each with its number; the angle at which each begins is `start_deg` of its number."""
    numbers = np.arange(count)
    nothing = np.zeros(32, np.float32)
    return [
        (number, protocol.SlamtecPacket(float(deg) % 360, False, nothing, nothing, np.zeros(32)))
        for number, deg in zip(numbers.tolist(), start_deg(numbers), strict=True)
    ]


def test_capsules_of_a_motor_that_starts_from_rest_are_placed():
    """They span more and more; two that span three times as much as the last have lost none between them."""
    count = PointCount(protocol.CAPSULES, CAPSULE_NS / 32, 256_000)
    placed = []
    for number, capsule in capsules(400, lambda n: 0.01 * n**2):
        placed.append(len(count.placed([(capsule, 0)], (number + 1) * CAPSULE_NS)))
    assert not count.broken and placed == [0] + [1] * 399


def test_a_lost_turn_that_no_angle_tells_breaks_the_count():
    count = PointCount(protocol.CAPSULES, CAPSULE_NS / 32, 256_000)
    heard = [one for one in capsules(600, lambda n: 7.2 * n) if not 200 <= one[0] < 250]  # 50 are a turn
    for number, capsule in heard:
        count.placed([(capsule, 0)], (number + 1) * CAPSULE_NS)
        assert number < 250 or (number - 250) * CAPSULE_NS < 0.5e9
        if count.broken:
            break
    assert count.broken and number >= 250

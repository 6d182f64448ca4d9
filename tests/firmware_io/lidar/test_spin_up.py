"""Lidars whose motor starts from rest, in every scan mode: turns are handed out, on time, and none is lost."""

import numpy as np
import pytest
from quick_tests import samples
from virtual_line import VirtualLine
from virtual_time import replace_time

from scanwright.firmware_io.emulators.slamtec.models import IDENTITIES
from scanwright.firmware_io.lidar import sensor_line
from scanwright.firmware_io.lidar.families import open_lidar
from scanwright.firmware_io.lidar.slamtec import dialogue, driver, protocol
from scanwright.firmware_io.lidar.slamtec.point_count import PointCount

MODES = [(model, number) for model, identity in IDENTITIES.items() for number in range(len(identity.modes))]
SLOW_S = 0.4  # by which a beam's time is read off its range


def clock_m(time_ns, bearing_rad):
    """A range that shows when it was measured: 1 to 5 m in 400 ms."""
    return 1.0 + 10 * (time_ns % round(SLOW_S * 1e9)) / 1e9, np.full(bearing_rad.size, 200.0)


def line_of(model, number, monkeypatch):
    line = VirtualLine(model, clock_m)
    replace_time(line, monkeypatch, "scanwright.firmware_io.lidar")
    monkeypatch.setattr(sensor_line, "open_stream", line.open)
    mode = IDENTITIES[model].modes[number]
    number = 0 if mode.kind == protocol.CAPSULES else number
    stream = dialogue.StreamMode(number, mode.kind, mode.point_us * 1e3)
    monkeypatch.setattr(driver, "typical_mode", lambda _: stream)
    return line


DAILY = [("RPLIDAR A1", 3), ("RPLIDAR S2", 1), ("RPLIDAR C1", 0)]


@pytest.mark.parametrize(("model", "number"), samples(MODES, DAILY))
def test_turns_come_while_the_motor_spins_up(model, number, monkeypatch):
    line = line_of(model, number, monkeypatch)
    with open_lidar("virtual", line.model) as lidar:
        before_ns = line.now_ns
        lidar.start()
        timed = [lidar.read() for _ in range(12)]
    assert timed[0].scan.stamp_ns - before_ns < 1.5e9
    speed_hz = 1 / np.diff([one.scan.stamp_ns / 1e9 for one in timed])
    assert speed_hz[0] < 0.85 * lidar.scan_rate_hz and speed_hz[-1] > 0.9 * lidar.scan_rate_hz
    assert lidar.dropped == lidar.bad_packets == 0
    for one in timed:
        true_ms = (one.scan.range_m.astype(float) - 1.0) * 100
        off_ms = (one.scan.time_ns / 1e6 - true_ms + 200) % (1e3 * SLOW_S) - 200
        assert np.nanmax(np.abs(off_ms)) < 3e-6 * one.uncertainty_ns + 1.0


@pytest.mark.parametrize("model", samples(["LD06", "LD19", "STL27L"], ["LD19"]))
def test_an_ldrobot_that_starts_from_rest_sends_no_bad_packets(model, monkeypatch):
    line = VirtualLine(model, clock_m)
    replace_time(line, monkeypatch, "scanwright.firmware_io.lidar")
    monkeypatch.setattr(sensor_line, "open_stream", line.open)
    with open_lidar("virtual", model) as lidar:
        line.machine.power_cycle(line.now_ns)
        lidar.start()
        line.sleep(1.0)
        timed = [lidar.read(3.0) for _ in range(12)]
        assert lidar.bad_packets == 0
    speed_hz = 1 / np.diff([one.scan.stamp_ns / 1e9 for one in timed])
    assert speed_hz[0] < 0.95 * lidar.scan_rate_hz and speed_hz[-1] > 0.9 * lidar.scan_rate_hz


class WireAt:
    """A sensor's line at one speed: at another, neither end understands a byte."""

    def __init__(self, line, sensor_baud):
        self._line, self._sensor_baud, self.baud, self.dtr = line, sensor_baud, 115_200, []

    def write(self, data):
        if self.baud == self._sensor_baud:
            self._line.write(data)

    def read(self, timeout_s):
        return self._line.read(timeout_s)

    def set_dtr(self, up):
        self.dtr.append(up)

    def close(self):
        self._line.close()


@pytest.mark.parametrize(("model", "baud"), [("RPLIDAR A2", 115_200), ("RPLIDAR A2", 256_000), ("RPLIDAR A1", 115_200)])
def test_it_answers_at_each_speed_of_its_series_and_its_motor_is_off_in_the_end(model, baud, monkeypatch):
    """The A2M8 has another speed than the A2M12; DTR stops the motor of an A1 when it is high."""
    wire = WireAt(line_of(model, 3, monkeypatch), baud)
    monkeypatch.setattr(sensor_line, "open_stream", lambda _: wire)
    monkeypatch.setattr(sensor_line.SensorLine, "serial", property(lambda _: wire))
    with open_lidar("virtual", model) as lidar:
        lidar.start()
        lidar.read()
    assert wire.baud == baud and wire.dtr == ([False, True] if model == "RPLIDAR A1" else [])


def test_a_motor_that_is_braked_and_let_go_does_not_freeze_the_count():
    """Arrivals come 16 ms late in bursts, as behind a USB adapter; nothing is lost, whatever the spans are."""
    capsule_ns, kind = 96 * 63_000, protocol.ULTRA
    speed = np.concatenate([np.linspace(0, 1, 80), np.ones(100), np.linspace(1, 0.05, 30), np.full(40, 0.05)])
    speed = np.concatenate([speed, np.linspace(0.05, 1, 30), np.ones(100)])
    start_deg = np.cumsum(22 * speed)
    count, placed, nothing = PointCount(kind, 63_000.0, 256_000), 0, np.zeros(96, np.float32)
    for number, deg in enumerate(start_deg):
        empty = protocol.SlamtecPacket(float(deg) % 360, False, nothing, nothing, np.zeros(96))
        arrival_ns = -(-(number + 1) * capsule_ns // 16_000_000) * 16_000_000
        placed += len(count.placed([(empty, 0)], arrival_ns))
        assert not count.broken
    assert placed == start_deg.size - 1

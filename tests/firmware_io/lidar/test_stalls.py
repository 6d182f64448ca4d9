"""A reader that is held up: beams of sensors without a clock of their own are on time, or dropped and counted."""

import numpy as np
import pytest
from quick_tests import samples

from benchmarks.firmware_io.devices.stalls import BUFFER_BYTES, MODELS, ROUNDED_MS, off_ms, random_stalls, scans_of
from scanwright.design.errors import DeviceTimeoutError
from scanwright.firmware_io.lidar import sensor_line
from scanwright.firmware_io.lidar.slamtec import protocol
from scanwright.firmware_io.lidar.slamtec.point_count import PointCount

STALLS = 3


LINES = [(model, size) for model in MODELS for size in BUFFER_BYTES]
DAILY = [(model, BUFFER_BYTES[k % 2]) for k, model in enumerate(MODELS)]  # each family with both buffers and latencies


@pytest.mark.parametrize(("model", "buffer_bytes"), samples(LINES, DAILY))
def test_beams_are_on_time_or_dropped_and_counted(model, buffer_bytes):
    stalls = random_stalls(np.random.default_rng([19, MODELS.index(model)]), STALLS, 0.5)
    stalls.append((sum(stalls[-1]) + 0.7, 2.0))
    timed, missing = scans_of(model, stalls, buffer_bytes)
    assert abs(missing.counted - missing.seen) <= STALLS  # the motor is not quite as fast as the catalogue says
    assert missing.seen > 8
    assert np.diff([one.scan.stamp_ns for one in timed]).min() > 0  # within a stated error of 8 ms and more at 16 ms
    for one in timed:
        off = np.abs(off_ms(one.scan))
        assert off.max(initial=0.0, where=~np.isnan(off)) < 3e-6 * one.uncertainty_ns + 2 * ROUNDED_MS[model]


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
    received = [one for one in capsules(600, lambda n: 7.2 * n) if not 200 <= one[0] < 250]  # 50 are a turn
    for number, capsule in received:
        count.placed([(capsule, 0)], (number + 1) * CAPSULE_NS)
        assert number < 250 or (number - 250) * CAPSULE_NS < 0.5e9
        if count.broken:
            break
    assert count.broken and number >= 250

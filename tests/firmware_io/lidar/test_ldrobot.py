"""LDROBOT lidars: bytes against the maker's example, the driver against the emulator, whatever breaks on the way."""

import os

import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.emulators import ldrobot as emulators
from scanwright.firmware_io.emulators.ldrobot import ldrobot_emulator
from scanwright.firmware_io.lidar.families import family_of, open_lidar
from scanwright.firmware_io.lidar.ldrobot import driver, protocol

# A packet that the maker's documents take apart.
EXAMPLE = bytes.fromhex(
    "542C6808AB7EE000E4DC00E2D900E5D500E3D300E4D000E9CD00E4CA00E2C700E9C500E5C200E5C000E5BE823A1A50"
)


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """Emulators share a computer with the tests: ten times as long."""
    monkeypatch.setattr(driver, "_FIRST_PACKETS_S", 5.0)


def lidar(model):
    return load_catalogue().products[model]


def wall_m(bearing_rad):
    return 2.0 + np.sin(bearing_rad)


class Ranging:
    """A smooth wall all around with a gap, and what was looked at when."""

    def __init__(self):
        self.looked = []

    def __call__(self, time_ns, bearing_rad):
        self.looked.append((time_ns, bearing_rad))
        gap = np.abs(np.remainder(bearing_rad + np.pi, 2 * np.pi) - np.pi) > 3.0
        return np.where(gap, np.inf, wall_m(bearing_rad)), np.full(time_ns.size, 800.0)

    def error_ns(self, scan):
        """How far the times of a scan are off, at the median of its beams."""
        time_ns, bearing_rad = (np.concatenate(part) for part in zip(*self.looked, strict=True))
        turned = np.unwrap(bearing_rad)
        told = np.interp(scan.time_ns.astype(float), time_ns.astype(float), turned)
        off_rad = np.remainder(told - scan.bearing_rad + np.pi, 2 * np.pi) - np.pi
        return float(np.median(off_rad)) / (2 * np.pi * 10) * 1e9


# Bytes


def test_the_example_of_the_documents_is_read():
    packet = protocol.packet(EXAMPLE)
    assert (packet.speed_deg_s, packet.stamp_ms) == (2152, 6714)
    np.testing.assert_allclose(packet.angle_deg[[0, -1]], [324.27, 334.70])
    np.testing.assert_allclose(np.diff(packet.angle_deg), (334.70 - 324.27) / 11)
    assert (packet.range_m[0], packet.intensity[0]) == (np.float32(0.224), 228)


def test_the_emulator_writes_the_example_of_the_documents():
    points = [[int(mm), int(level)] for mm, level in zip(*_read(EXAMPLE), strict=True)]
    assert emulators.write_packet(2152, 324.27, 334.70, 6714, points) == EXAMPLE


def _read(data):
    rows = [data[6 + 3 * k : 9 + 3 * k] for k in range(12)]
    return [row[0] | row[1] << 8 for row in rows], [row[2] for row in rows]


@pytest.mark.parametrize("at", range(protocol.SIZE))
def test_a_flipped_bit_is_a_wrong_packet(at):
    for bit in range(8):
        broken = bytes(byte ^ (1 << bit if k == at else 0) for k, byte in enumerate(EXAMPLE))
        with pytest.raises(ProtocolError):
            protocol.packet(broken)


def test_a_packet_over_the_front_goes_on_at_zero():
    data = emulators.write_packet(3600, 356.0, 4.8, 29_999, [[1000, 9]] * 11 + [[0, 0]])
    packet = protocol.packet(data)
    np.testing.assert_allclose(packet.angle_deg, (356 + 0.8 * np.arange(12)) % 360)
    assert np.isnan(packet.range_m[-1]) and packet.stamp_ms == 29_999


def test_packets_are_found_again_behind_garbage_and_a_cut():
    splitter = protocol.LdrobotSplitter()
    stream = b"\x2c\x54" + EXAMPLE + b"\x54" * 60 + EXAMPLE[:20] + EXAMPLE + EXAMPLE
    found = [packet for k in range(0, len(stream), 7) for packet in splitter.feed(stream[k : k + 7])]
    assert [packet.stamp_ms for packet in found] == [6714] * 3
    assert splitter.bad == 3


@seed(19)
@settings(max_examples=300)
@given(st.data())
def test_damaged_streams_give_packets_or_nothing(data):
    stream = bytearray(EXAMPLE * 4)
    for _ in range(data.draw(st.integers(0, 12))):
        at = data.draw(st.integers(0, len(stream) - 1))
        kind = data.draw(st.integers(0, 2))
        if kind == 0:
            stream[at] = data.draw(st.integers(0, 255))
        elif kind == 1:
            del stream[at : at + data.draw(st.integers(1, 60))]
        else:
            stream[at:at] = data.draw(st.binary(max_size=60))
        stream = stream or bytearray(b"\x54")
    splitter = protocol.LdrobotSplitter()
    found = splitter.feed(bytes(stream))
    assert len(found) <= len(stream) // protocol.SIZE
    # whatever came before, an undamaged packet is found behind it, at the latest the one after the next
    assert splitter.feed(EXAMPLE * 3)[-1].stamp_ms == 6714


# The driver


@pytest.mark.parametrize("model", ["LD06", "LD19", "STL27L"])
def test_turns_come_as_they_were_seen_and_when(model):
    ranging = Ranging()
    emulator = ldrobot_emulator(lidar(model), ranging, rate_error=5e-5, first_ms=29_700)
    with emulator, open_lidar(emulator.port, model) as ours:
        assert (ours.model, ours.scan_rate_hz) == (model, 10.0)
        ours.start(intensity=True)
        timed = [ours.read() for _ in range(12)]
        assert ours.bad_packets == 0
    usual = lidar(model).steps_per_turn
    sizes = [one.scan.range_m.size for one in timed]
    assert min(sizes) > 0.9 * usual and max(sizes) < 1.02 * usual and len(set(sizes)) > 1  # its speed wanders
    for one in timed:
        scan = one.scan
        assert -0.2 < scan.bearing_rad[0] <= 0 and np.all(np.diff(scan.bearing_rad) < 0)  # clockwise
        lost = np.isnan(scan.range_m)
        assert 0.02 < lost.mean() < 0.07
        np.testing.assert_allclose(scan.range_m[~lost], wall_m(scan.bearing_rad[~lost]), atol=6e-4)
        assert scan.intensity.size == scan.range_m.size
        assert scan.time_ns[-1] < one.arrival_ns
    errors_ns = [ranging.error_ns(one.scan) for one in timed[2:]]
    # a busy computer lets packets wait; what that may cost at most: test_stalls.py, on a clock of its own
    assert np.abs(errors_ns).min() < 2e6


def test_nobody_can_tell_the_first_two_apart_but_the_third():
    with ldrobot_emulator(lidar("STL27L"), Ranging()) as emulator:
        with open_lidar(emulator.port) as ours:
            assert ours.model == "STL27L"
        with pytest.raises(DeviceError, match="points/s: this is a STL27L, not a LD19"):
            open_lidar(emulator.port, "LD19")
    with ldrobot_emulator(lidar("LD19"), Ranging()) as emulator, open_lidar(emulator.port) as ours:
        assert ours.model in ("LD06", "LD19")


def test_bad_packets_are_counted_and_never_handed_out():
    with ldrobot_emulator(lidar("LD19"), Ranging()) as emulator, open_lidar(emulator.port, "LD19") as ours:
        ours.start()
        ours.read()
        emulator.garble(5)
        emulator.cut(5)
        for _ in range(6):
            scan = ours.read().scan
            seen = ~np.isnan(scan.range_m)
            np.testing.assert_allclose(scan.range_m[seen], wall_m(scan.bearing_rad[seen]), atol=6e-4)
            assert scan.intensity.size == 0
        assert 2 <= ours.bad_packets <= 12


def test_an_unplugged_sensor_is_told_and_found_again():
    with ldrobot_emulator(lidar("LD19"), Ranging()) as emulator, open_lidar(emulator.port, "LD19") as ours:
        ours.start()
        ours.read()
        emulator.unplug()
        with pytest.raises(DeviceError):
            for _ in range(5):
                ours.read(0.3)
        with pytest.raises(DeviceError, match=r"did not come back in 0\.1 s"):
            ours.reconnect(0.1)
        emulator.plug()
        ours.reconnect(20.0)
        assert ours.read().scan.range_m.size > 400


def test_a_sensor_that_lost_its_power_is_silent_then_starts_anew():
    with (
        ldrobot_emulator(lidar("LD19"), Ranging(), first_ms=17_000) as emulator,
        open_lidar(emulator.port, "LD19") as ours,
    ):
        ours.start()
        ours.read()
        emulator.power_cycle()
        with pytest.raises(DeviceTimeoutError, match="nothing came in time"):
            for _ in range(8):
                ours.read(0.1)
        ours.reconnect(20.0)
        timed = ours.read()
        assert 0 < timed.arrival_ns - timed.scan.time_ns[-1] < 1e9


def test_a_port_where_something_else_or_nothing_talks(monkeypatch):
    monkeypatch.setattr(driver, "_FIRST_PACKETS_S", 0.2)
    master, slave = os.openpty()
    try:
        with pytest.raises(DeviceTimeoutError, match="no LDROBOT sensor answers"):
            open_lidar(os.ttyname(slave), "LD19")
        os.write(master, bytes(range(256)) * 8)
        with pytest.raises(DeviceTimeoutError, match="no LDROBOT sensor answers"):
            open_lidar(os.ttyname(slave), "LD19")
    finally:
        os.close(master)
        os.close(slave)


def test_what_it_cannot_is_said():
    assert not family_of("LD19").stamp_choices
    with ldrobot_emulator(lidar("LD19"), Ranging()) as emulator:
        with pytest.raises(DeviceError, match="stamp_at"):
            open_lidar(emulator.port, "LD19", "rear")
        with open_lidar(emulator.port, "LD19") as ours:
            with pytest.raises(DeviceError, match="cluster = 2"):
                ours.start(cluster=2)
            with pytest.raises(DeviceError, match="not started"):
                ours.read()
            ours.start(skip=1)
            begins = [ours.read().scan.stamp_ns for _ in range(3)]
            assert np.diff(begins).min() > 1.5e8

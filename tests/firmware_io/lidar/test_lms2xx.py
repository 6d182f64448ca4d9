"""SICK LMS 2xx: bytes against published ones, the driver against the emulator by a clock of their own."""

import numpy as np
import pytest
import virtual_line
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from virtual_line import VirtualLine
from virtual_time import replace_time

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import DeviceError, DeviceFaultError, ProtocolError
from scanwright.firmware_io.emulators.sick.lms_emulator import lms_emulator, write_telegram
from scanwright.firmware_io.lidar import byte_stream, sensor_line
from scanwright.firmware_io.lidar.families import open_lidar
from scanwright.firmware_io.lidar.lms2xx import driver, protocol
from scanwright.firmware_io.scan.lidar_scans import CLOCK_GOOD_NS

# As users of the telegram listing write them, with their sums.
REQUESTS = [
    (protocol.telegram(protocol.MODE, b"\x24"), "02 00 02 00 20 24 34 08"),
    (protocol.telegram(protocol.MODE, b"\x25"), "02 00 02 00 20 25 35 08"),
    (protocol.telegram(0x31), "02 00 01 00 31 15 12"),
    (protocol.telegram(protocol.TYPE), "02 00 01 00 3A 1E 12"),
    (protocol.telegram(protocol.MODE, b"\x42"), "02 00 02 00 20 42 52 08"),
    (protocol.telegram(protocol.MODE, b"\x48"), "02 00 02 00 20 48 58 08"),
]


@pytest.mark.parametrize(("ours", "published"), REQUESTS)
def test_requests_are_those_that_are_published(ours, published):
    assert ours == bytes.fromhex(published)
    assert write_telegram(ours[4:-2], address=0) == ours  # the emulator's sum is another program


# What the example programs of sicktoolbox ask beyond our driver: command and values, and how the answer begins.
OTHER_REQUESTS = [
    ("74", "F4 00 00 46 00 01 00 01"),
    ("32", "B2"),
    ("77" + "00" * 34, "F7 00 00 00 46 00 01 00 01"),  # not in installation mode
    ("20 00" + b"SICK_XXX".hex(), "A0 01"),  # a wrong password of the installation mode
    ("20 00" + b"SICK_LMS".hex(), "A0 00"),
    ("77 00 00 46 00 01 00 00" + "00" * 27, "F7 01 00 00 46 00 01 00 00"),
    ("20 25", "A0 00"),
    ("74", "F4 00 00 46 00 01 00 00"),
    ("3B 64 00 19 00", "BB 01 64 00 19 00"),
    ("3B B4 00 19 00", "BB 00 B4 00 19 00"),
    ("31", "B1" + b"V02.30 ".hex() + "25"),
]


def test_an_emulator_answers_what_other_programs_ask():
    machine = VirtualLine("LMS 200", Wall()).machine
    for request, begins in OTHER_REQUESTS:
        asked = write_telegram(bytes.fromhex(request), address=0)
        answer, _ = machine.receive(asked, machine.began_ns + 1)
        assert answer[:3] == b"\x06\x02\x80"
        assert answer[5:].startswith(bytes.fromhex(begins)), request
    status = answer[5:]
    assert (len(status), status[107:111], status[122]) == (155, bytes([100, 0, 25, 0]), 0)
    assert not machine.millimetres


def telegrams(ranges, kind=0x4000, status=0x10):
    payload = b"\xb0" + (len(ranges) | kind).to_bytes(2, "little") + np.array(ranges, "<u2").tobytes()
    return write_telegram(payload + bytes([status]))


def test_ranges_are_in_the_unit_that_they_say_and_codes_are_none():
    (told,) = protocol.LmsSplitter().feed(telegrams([1234, 0, 0x1FF7, 0x1FFE, 0x2000 | 500]))
    np.testing.assert_array_equal(protocol.scan(told).range_m, np.float32([1.234, np.nan, np.nan, np.nan, 0.5]))
    (told,) = protocol.LmsSplitter().feed(telegrams([1234], kind=0))
    assert protocol.scan(told).range_m[0] == np.float32(12.34)
    for kind in (0x2000, 0x8000, 0x4002):  # a part of a scan, an unknown unit, another count
        (told,) = protocol.LmsSplitter().feed(telegrams([1234], kind=kind))
        with pytest.raises(ProtocolError):
            protocol.scan(told)


@seed(19)
@settings(max_examples=300, deadline=None)
@given(st.data())
def test_damaged_streams_give_telegrams_or_nothing(data):
    whole = telegrams([1000 + k for k in range(20)])
    stream = bytearray(b"\x06" + whole * 3)
    for _ in range(data.draw(st.integers(0, 12))):
        at = data.draw(st.integers(0, len(stream) - 1))
        kind = data.draw(st.integers(0, 2))
        if kind == 0:
            stream[at] = data.draw(st.integers(0, 255))
        elif kind == 1:
            del stream[at : at + data.draw(st.integers(1, 60))]
        else:
            stream[at:at] = data.draw(st.binary(max_size=60))
        stream = stream or bytearray(b"\x02")
    splitter = protocol.LmsSplitter()
    for told in splitter.feed(bytes(stream)):
        try:
            protocol.scan(told)
        except ProtocolError:
            continue
    # whatever came before, an undamaged telegram is found behind as much as one may be long
    assert splitter.feed(bytes(protocol.LONGEST) + whole)[-1].values[-1] == 0x10


# The driver


class Wall:
    """A smooth wall with a gap, and when it was looked at in which direction."""

    def __init__(self):
        self.time_ns, self.bearing_rad = [], []

    def __call__(self, time_ns, bearing_rad):
        self.time_ns.append(time_ns)
        self.bearing_rad.append(bearing_rad)
        return np.where(np.abs(bearing_rad) > 1.4, np.inf, 2.0 + np.sin(bearing_rad)), np.zeros(time_ns.size)

    def error_ns(self, scan):
        """Of each beam's time: how far from the nearest look in that direction."""
        time_ns, bearing_rad = np.concatenate(self.time_ns), np.concatenate(self.bearing_rad)
        off = []
        for told_ns, told_rad in list(zip(scan.time_ns, scan.bearing_rad, strict=True))[::20]:
            looks_ns = time_ns[np.abs(bearing_rad - told_rad) < 1e-6]
            off.append(np.abs(looks_ns - told_ns).min())
        return np.array(off)


@pytest.fixture
def opened(monkeypatch):
    """A lidar on its line, and what it looks at."""
    with_lidar = []

    def make(model="LMS 200", **state):
        wall = Wall()
        line = VirtualLine(model, wall)
        for name, value in state.items():
            setattr(line.machine, name, value)
        replace_time(line, monkeypatch, "scanwright.firmware_io.lidar")
        monkeypatch.setattr(sensor_line, "open_stream", line.open)
        lidar = open_lidar("virtual", model)
        with_lidar.append(lidar)
        return lidar, line, wall

    yield make
    for lidar in with_lidar:
        lidar.__exit__(None, None, None)


@pytest.mark.parametrize("model", ["LMS 200", "LMS 291"])
@pytest.mark.parametrize("millimetres", [True, False])
def test_each_turn_of_the_mirror_is_a_scan_at_its_time(opened, model, millimetres):
    lidar, line, wall = opened(model, millimetres=millimetres)
    assert (lidar.model, lidar.firmware, lidar.serial_number, lidar.scan_rate_hz) == (model, "V02.30", "", 75.0)
    line.machine.baud = 500_000
    lidar.start()
    scans = [lidar.read().scan for _ in range(60)]
    assert [scan.range_m.size for scan in scans[:4]] == [181, 180, 181, 180]
    bearing_rad = load_catalogue().products[model].bearings_rad()
    for whole, half in zip(scans[::2], scans[1::2], strict=True):
        np.testing.assert_allclose(whole.bearing_rad, bearing_rad[::2], atol=1e-9)
        np.testing.assert_allclose(half.bearing_rad, bearing_rad[1::2], atol=1e-9)
    for scan in scans:
        seen = np.isfinite(scan.range_m)
        assert np.array_equal(seen, np.abs(scan.bearing_rad) <= 1.4)
        expected_m = 2.0 + np.sin(scan.bearing_rad[seen])
        np.testing.assert_allclose(scan.range_m[seen], expected_m, atol=6e-4 if millimetres else 6e-3)
    for scan in scans[10:]:
        assert wall.error_ns(scan).max() < 300_000  # its motor turns a thousandth too fast
    assert (lidar.bad_packets, lidar.dropped) == (0, 0)
    assert lidar.read().uncertainty_ns < CLOCK_GOOD_NS  # which a scan waits for


def test_lost_and_damaged_telegrams_are_counted_and_never_handed_out(opened):
    lidar, line, wall = opened()
    line.machine.baud = 500_000
    lidar.start()
    for _ in range(10):
        lidar.read()
    line.damage.extend([lambda told: told[:300] + bytes([told[300] ^ 4]) + told[301:], lambda told: told[:-40]])
    scans = [lidar.read().scan for _ in range(20)]
    for scan in scans:
        seen = np.isfinite(scan.range_m)
        np.testing.assert_allclose(scan.range_m[seen], 2.0 + np.sin(scan.bearing_rad[seen]), atol=6e-4)
        assert wall.error_ns(scan).max() < 1_500_000
    assert lidar.bad_packets >= 1 and lidar.dropped == 4


@pytest.mark.parametrize(("buffer_ns", "lost"), [(10**9, 0), (0, 8)], ids=["late", "lost"])
def test_what_is_late_is_not_lost_and_both_keep_their_times(opened, monkeypatch, buffer_ns, lost):
    lidar, line, wall = opened()
    line.machine.baud = 500_000
    monkeypatch.setattr(virtual_line, "_BUFFER_NS", buffer_ns)
    lidar.start()
    for _ in range(40):
        assert wall.error_ns(lidar.read().scan).max() < 1_000_000
    line.sleep(0.12)  # the computer does something else
    for _ in range(40):
        assert wall.error_ns(lidar.read().scan).max() < 1_000_000
    assert lidar.dropped == lost


def test_a_slow_line_loses_turns_and_says_so(opened):
    lidar, _, wall = opened()
    lidar._baud = 9600
    lidar.start()
    timed = [lidar.read() for _ in range(8)]
    assert "at 9600 baud most turns are lost" in timed[-1].warning
    assert lidar.dropped > 100
    assert wall.error_ns(timed[-1].scan).max() < 10_000_000


def test_a_fault_and_a_dirty_window_are_told(opened):
    lidar, line, _ = opened()
    line.machine.baud = 500_000
    lidar.start()
    line.machine.status = 0x90
    assert [lidar.read().warning for _ in range(4)][-1] == "its window is dirty: clean it"
    line.machine.status = 0x13
    with pytest.raises(DeviceFaultError, match="fault"):
        for _ in range(4):
            lidar.read()


def test_what_it_cannot_is_said(opened):
    lidar, line, _ = opened()
    line.machine.baud = 500_000
    for wish, what in (({"intensity": True}, "intensity"), ({"cluster": 2}, "cluster = 2")):
        with pytest.raises(DeviceError, match=what):
            lidar.start(**wish)
    with pytest.raises(DeviceError, match="not started"):
        lidar.read()
    lidar.start(skip=1)
    assert {lidar.read().scan.range_m.size for _ in range(4)} == {180}
    with pytest.raises(DeviceError, match=r"reports type 'LMS200;30106;V02\.30': not a LMS 291"):
        open_lidar("virtual", "LMS 291")


class VirtualPort(byte_stream.SerialStream):
    """A virtual line whose ends receive only noise, or nothing, at different baud rates."""

    def __init__(self, line):
        self.line, self.speed, self.answers_at = line, byte_stream.FIRST_BAUD, 0

    @property
    def baud(self):
        return self.speed

    @baud.setter
    def baud(self, baud):
        self.speed = baud

    def can(self, _baud):
        return True

    def write(self, data):
        if self.speed == self.line.machine.baud:
            self.answers_at = self.speed  # also where it changes to another one
            self.line.write(data)

    def read(self, timeout_s):
        data = self.line.read(timeout_s)
        baud = self.answers_at or self.line.machine.baud
        if data:
            self.answers_at = 0
        return data if self.speed == baud else b"\xf8" * len(data)

    def close(self):
        self.line.close()


@pytest.mark.parametrize("fault", ["brown-out", "unplugged", "unplugged while it changes its speed"])
def test_after_an_interruption_it_is_found_at_the_speed_that_it_has_by_then(monkeypatch, fault):
    line = VirtualLine("LMS 200", Wall())
    replace_time(line, monkeypatch, "scanwright.firmware_io.lidar")
    monkeypatch.setattr(sensor_line, "open_stream", lambda address: VirtualPort(line.open(address)))
    monkeypatch.setattr(sensor_line, "TURN_S", 1.0)
    with open_lidar("virtual", "LMS 200") as lidar:
        lidar.start()
        assert lidar.read().scan.range_m.size == 181 and line.machine.baud == 500_000
        if fault == "brown-out":
            line.machine.power_cycle(line.now_ns)
        else:
            line.unplug()
        if fault == "unplugged while it changes its speed":
            line.machine.power_cycle(line.now_ns - 10**9)
            receive = line.machine.receive

            def speed_answered_into_the_void(received, now_ns):
                reply, rest = receive(received, now_ns)
                if line.machine.baud == 500_000:
                    line.machine.receive = receive
                    return b"", rest
                return reply, rest

            line.machine.receive = speed_answered_into_the_void
        began_ns = line.now_ns
        with pytest.raises(DeviceError):
            for _ in range(4):
                lidar.read()
        line.plugged = True
        lidar.reconnect(10.0)
        assert np.isfinite(lidar.read().scan.range_m).any()
        assert line.machine.baud == 500_000
        most_s = {"brown-out": 1.3, "unplugged": 0.1}.get(fault, driver._MODE_S + 1.3)
        assert (line.now_ns - began_ns) / 1e9 < most_s


class SlowPort(byte_stream.SerialStream):
    """A real line, whose sensor receives only bytes at its present baud rate."""

    machine = None

    def can(self, baud):
        return baud <= 115_200

    def write(self, data):
        if self.baud == self.machine.baud:
            super().write(data)


def test_the_speed_of_a_serial_line_is_found_and_raised_as_far_as_the_adapter_can(monkeypatch):
    monkeypatch.setattr(byte_stream, "SerialStream", SlowPort)
    with lms_emulator(load_catalogue().products["LMS 200"], Wall()) as emulator:
        monkeypatch.setattr(SlowPort, "machine", emulator.machine)
        emulator.machine.baud = 19_200
        monkeypatch.setattr(driver, "_REPLY_S", 0.3)
        with open_lidar(emulator.port, "LMS 200") as lidar:
            lidar.start()
            assert emulator.machine.baud == 38_400
            assert "38400 baud" in lidar.read(20.0).warning
        assert emulator.machine.scanning is None

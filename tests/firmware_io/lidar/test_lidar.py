"""The lidar driver against the emulator: whatever state the sensor is in, whatever breaks on the way."""

import itertools
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scanwright.design.errors import DeviceError, DeviceTimeoutError
from scanwright.firmware_io.emulators import hokuyo_models, lidar_machine
from scanwright.firmware_io.emulators.lidar import hokuyo_emulator
from scanwright.firmware_io.lidar import byte_stream, sensor_line
from scanwright.firmware_io.lidar.byte_stream import SerialStream
from scanwright.firmware_io.lidar.scip import dialogue, protocol
from scanwright.firmware_io.lidar.scip.driver import ScipLidar

SEEN_M = np.linspace(0.6, 5.2, 1081)


def look(time_ns):
    range_m = SEEN_M[: time_ns.size].copy()
    range_m[[3, 40]] = np.inf
    return range_m, np.arange(time_ns.size, dtype=float)


def check(raw, count):
    expected = np.round(look(np.zeros(count))[0], 3).astype(np.float32)
    np.testing.assert_array_equal(raw.range_m, np.where(np.isinf(expected), np.nan, expected))


@pytest.mark.parametrize("way", ["port", "address"])
@pytest.mark.parametrize(("model", "beams"), [("UTM-30LX", 1081), ("URG-04LX", 682)])
def test_scans_come_as_they_were_seen(way, model, beams):
    with hokuyo_emulator(model, look) as emulator, ScipLidar(getattr(emulator, way)) as lidar:
        assert (lidar.model, lidar.firmware) == (model, emulator.machine.identity.firmware)
        assert lidar.serial_number == emulator.machine.identity.serial_number
        assert lidar.parameters == emulator.machine.identity.parameters
        intensity = emulator.machine.identity.intensity
        lidar.start(intensity=intensity)
        stamps_ms = []
        for _ in range(4):
            scan = lidar.read().scan
            check(scan, beams)
            assert scan.intensity.tolist() == (list(range(beams)) if intensity else [])
            stamps_ms.append(lidar._stamp_ms)
        steps_ms = np.diff(stamps_ms)
        period_ms = lidar.parameters.scan_period_s * 1002  # the motor's error is a default of the emulator
        assert np.all(np.abs(steps_ms - period_ms) <= 1)
        assert (lidar.dropped, lidar.bad_packets) == (0, 0)
    assert not emulator.machine.laser  # `with` puts the laser out


@pytest.mark.parametrize("state", ["scanning", "scip_1", "adjusting its time", "half a request"])
def test_the_sensor_may_be_in_any_state(state):
    options = {state: True} if state in ("scanning", "scip_1") else {}
    with hokuyo_emulator("UTM-30LX", look, **options) as emulator:
        if state == "adjusting its time":
            emulator.machine.answer(b"TM0", time.monotonic_ns())
        if state == "half a request":
            Path(emulator.port).write_bytes(b"MD0000")
        with ScipLidar(emulator.port) as lidar:
            lidar.start()
            check(lidar.read().scan, 1081)
            assert lidar.bad_packets == 0


def test_clusters_and_skips():
    with hokuyo_emulator("UTM-30LX", look) as emulator, ScipLidar(emulator.port) as lidar:
        lidar.start(cluster=5, skip=1)
        scan, first_ms = lidar.read().scan, lidar._stamp_ms
        lidar.read()
        assert lidar._stamp_ms - first_ms in (50, 51)
        assert lidar.dropped == 0
        valid = np.where(np.isinf(look(SEEN_M)[0]), 99, look(SEEN_M)[0])
        expected = [valid[k : k + 5].min() for k in range(0, 1081, 5)]
        np.testing.assert_allclose(scan.range_m, expected, atol=6e-4)
        assert scan.range_m.size == 217 == -(-lidar.parameters.window.size // 5)
        # The middle one of five steps: two steps after the first.
        assert scan.angle_min_rad == pytest.approx(np.radians(-135 + 2 * 0.25))
        assert scan.bearing_rad[108] == pytest.approx(np.radians((108 * 5 + 2 - 540) * 0.25))
        assert np.diff(scan.time_ns)[0] == pytest.approx(5 * 0.025 / 1440 * 1e9, abs=1)


@pytest.mark.parametrize(("model", "intensity"), [("UTM-30LX", True), ("URG-04LX", False)])
def test_first_beams_get_their_true_times(model, intensity):
    true_ns = []

    def timed(time_ns):
        true_ns.append(int(time_ns[0]))
        return look(time_ns)

    with (
        hokuyo_emulator(model, timed, rate_error=5e-5, clock_ms=(1 << 24) - 300) as emulator,
        ScipLidar(emulator.port) as lidar,
    ):
        assert lidar.sync is not None
        lidar.start(intensity=intensity)
        true_ns.clear()
        errors_ns, wrapped = [], False
        for _ in range(12):
            told_ns = lidar.read().scan.stamp_ns
            lidar.read()
            wrapped |= lidar._stamp_ms >= 1 << 24
            errors_ns.append(min(abs(told_ns - time_ns) for time_ns in true_ns))  # a busy emulator leaves turns out
        assert wrapped
        # Within what the synchronisation allows: a busy machine answers late, and no scan here comes early.
        assert max(errors_ns) < lidar.sync.half_width_ns + 1_500_000


def test_bad_packets_are_counted_and_never_handed_out():
    with hokuyo_emulator("UTM-30LX", look) as emulator, ScipLidar(emulator.port) as lidar:
        lidar.start(intensity=True)
        lidar.read()
        emulator.garble(3)
        emulator.cut(3)
        for _ in range(40):  # on a busy computer some packets were under way before
            check(lidar.read().scan, 1081)
            if lidar.bad_packets >= 6:
                break
        assert 6 <= lidar.bad_packets <= 9  # a lost end takes the next one with it
        assert lidar.dropped >= 3  # on a busy computer the emulator leaves out some more


@pytest.mark.parametrize("way", ["port", "address"])
def test_an_unplugged_sensor_is_told_and_comes_back(way):
    with hokuyo_emulator("UTM-30LX", look) as emulator, ScipLidar(getattr(emulator, way)) as lidar:
        lidar.start(intensity=True)
        lidar.read()
        emulator.unplug()
        with pytest.raises(DeviceError, match="plug") as told:
            for _ in range(10):
                lidar.read()
        assert str(told.value).count("\n") == 0
        assert not isinstance(told.value, DeviceTimeoutError)
        with pytest.raises(DeviceError, match=r"00903971 did not come back in 0\.1 s"):
            lidar.reconnect(0.1)
        with pytest.raises(DeviceError, match="plug it in again"):
            lidar.read()
        emulator.plug()
        lidar.reconnect(30.0)
        scan = lidar.read().scan
        check(scan, 1081)
        assert (lidar._counter.restarts, scan.intensity.size) == (1, 1081)


def test_a_sensor_is_found_by_its_serial_number_and_not_by_its_port(tmp_path):
    name = tmp_path / "ttyACM0"
    with (
        hokuyo_emulator("UTM-30LX", look) as ours,
        hokuyo_emulator("UTM-30LX", lambda t: (look(t)[0] + 1, look(t)[1])) as other,
    ):
        other.machine.identity = replace(other.machine.identity, serial_number="00900001")
        name.symlink_to(ours.port)
        with ScipLidar(str(name), search=lambda: [other.port, str(tmp_path / "gone"), ours.port]) as lidar:
            lidar.start()
            ours.unplug()
            with pytest.raises(DeviceError):
                for _ in range(10):
                    lidar.read()
            name.unlink()
            name.symlink_to(other.port)  # another sensor took its place
            ours.plug()
            lidar.reconnect(30.0)
            check(lidar.read().scan, 1081)
            assert (lidar.address, lidar.serial_number) == (ours.port, "00903971")
            assert not other.machine.laser


def test_a_sensor_that_lost_its_power_is_silent_then_starts_anew():
    with hokuyo_emulator("UTM-30LX", look, clock_ms=1_000_000) as emulator, ScipLidar(emulator.port) as lidar:
        lidar.start()
        lidar.read()
        before_ms = lidar._stamp_ms
        emulator.power_cycle()
        with pytest.raises(DeviceTimeoutError, match="nothing came in time"):
            for _ in range(5):
                lidar.read(0.1)
        lidar.reconnect(30.0)
        timed = lidar.read()
        assert lidar._stamp_ms < 60_000 < before_ms
        assert lidar._counter.restarts == 1
        late_ns = timed.arrival_ns - timed.scan.stamp_ns
        assert 0 < late_ns < 5_000_000_000


def test_a_fault_of_the_sensor_is_told_and_the_laser_is_put_out():
    with hokuyo_emulator("UTM-30LX", look) as emulator:
        with pytest.raises(DeviceError, match="hardware fault"), ScipLidar(emulator.port) as lidar:
            lidar.start()
            answer = emulator.machine.next_scan
            emulator.machine.next_scan = lambda: answer()[:0] + protocol.reply(lidar._request, "55")
            lidar.read()
        assert not emulator.machine.laser


def test_what_a_sensor_cannot_do_is_told():
    with hokuyo_emulator("URG-04LX", look) as emulator, ScipLidar(emulator.port) as lidar:
        with pytest.raises(DeviceError, match="ME0044072501000: status 0E"):
            lidar.start(intensity=True)
        with pytest.raises(DeviceError, match="cluster = 0"):
            lidar.start(cluster=0)


def test_absent_ports_and_ports_in_use_are_told(tmp_path):
    with pytest.raises(DeviceError, match="ttyACM7: no such port; serial ports here: "):
        ScipLidar(str(tmp_path / "ttyACM7"))
    with pytest.raises(DeviceError, match=r"127\.0\.0\.1:1: cannot connect: Connection refused: check address"):
        ScipLidar("127.0.0.1:1")
    with pytest.raises(DeviceError, match="this is no serial port"):
        ScipLidar("/dev/null")
    with (
        hokuyo_emulator("UTM-30LX", look) as emulator,
        ScipLidar(emulator.port),
        pytest.raises(DeviceError, match="another program has it open"),
    ):
        ScipLidar(emulator.port)


def test_a_port_where_no_lidar_answers(monkeypatch):
    monkeypatch.setattr(dialogue, "_REPLY_S", 0.02)
    master, slave = os.openpty()
    try:
        with pytest.raises(DeviceTimeoutError, match="no SCIP sensor answers"):
            ScipLidar(os.ttyname(slave))
    finally:
        os.close(master)
        os.close(slave)


class LossyPort(SerialStream):
    """A line that loses what is sent at the wrong speed: a reply is waited for long only where one can come."""

    @property
    def baud(self):
        return super().baud

    @baud.setter
    def baud(self, baud):
        SerialStream.baud.fset(self, baud)
        dialogue._REPLY_S = 5.0 if self.passes() else 0.1

    def write(self, data):
        if self.passes():
            super().write(data)


class SlowPort(LossyPort):
    """A real line, whose sensor listens at the speed that it has after power-up, until it is told another one."""

    listens = 19_200
    fastest = 750_000  # of the adapter

    def can(self, baud):
        return baud <= self.fastest

    def passes(self):
        return self.baud == self.listens

    def write(self, data):
        super().write(data)
        if self.passes() and data.startswith(b"SS"):
            self.listens = int(data[2:])


@pytest.mark.parametrize("fastest", [750_000, 115_200])
def test_a_sensor_at_another_speed_is_found_and_sped_up(monkeypatch, fastest):
    """A URG-04LX needs 216 kbit/s for ten scans; 115,200 is all that some adapters give."""
    monkeypatch.setattr(byte_stream, "SerialStream", SlowPort)
    monkeypatch.setattr(SlowPort, "fastest", fastest)
    monkeypatch.setattr(dialogue, "_REPLY_S", 0.1)
    with hokuyo_emulator("URG-04LX", look) as emulator, ScipLidar(emulator.port) as lidar:
        assert lidar._line.stream.listens == lidar._line.stream.baud == 115_200
        lidar.start()
        assert lidar._line.stream.listens == lidar._line.stream.baud == (250_000 if fastest == 750_000 else 115_200)
        check(lidar.read().scan, 682)


class BadLine(LossyPort):
    """A line that loses what is faster than 115,200, whatever both ends are set to."""

    def passes(self):
        return self.baud == 115_200


def test_a_line_that_is_not_good_for_more_speed_keeps_its_speed(monkeypatch):
    monkeypatch.setattr(byte_stream, "SerialStream", BadLine)
    monkeypatch.setattr(dialogue, "_REPLY_S", 5.0)
    with hokuyo_emulator("URG-04LX", look) as emulator, ScipLidar(emulator.port) as lidar:
        lidar.start()
        assert lidar._line.stream.baud == 115_200
        check(lidar.read().scan, 682)


def test_the_clock_of_a_firmware_that_tells_it_wrongly_is_not_asked_for(monkeypatch):
    told = replace(hokuyo_models.IDENTITIES["UTM-30LX"], firmware="1.16.02(19/Jan./2010)")
    monkeypatch.setitem(hokuyo_models.IDENTITIES, "UTM-30LX", told)
    asked, answer = [], lidar_machine.LidarMachine.answer

    def listening(self, request, now_ns):
        asked.append(request)
        return answer(self, request, now_ns)

    monkeypatch.setattr(lidar_machine.LidarMachine, "answer", listening)
    with hokuyo_emulator("UTM-30LX", look) as emulator, ScipLidar(emulator.port) as lidar:
        assert lidar.sync is None
        lidar.start()
        check(lidar.read().scan, 1081)
    assert b"PP" in asked and b"TM0" not in asked


class AsleepStream:
    """What came while the program was kept from running, in pieces as small as a pseudo-terminal's."""

    def __init__(self, waiting):
        self.waiting = waiting

    def read(self, timeout_s):
        assert timeout_s < 0, "the deadline has passed"
        taken, self.waiting = self.waiting[:100], self.waiting[100:]
        return taken


def test_a_reply_that_waits_for_a_late_host_counts(monkeypatch):
    told = protocol.reply(b"PP", "00", protocol.text_lines([("MODL", "x" * 500)]))
    monkeypatch.setattr(sensor_line, "open_stream", lambda _: AsleepStream(told))
    line = sensor_line.SensorLine("wire", protocol.LONGEST_REPLY)
    line.split_by(protocol.Splitter())
    (found,), _ = line.receive(time.monotonic() - 10.0)
    assert found.echo == b"PP"
    for waiting in (b"", b"x" * 100_000):
        line.stream = AsleepStream(waiting)
        line.split_by(protocol.Splitter())
        with pytest.raises(DeviceTimeoutError, match="nothing came in time"):
            line.receive(time.monotonic() - 10.0)


def test_lost_packets_count_across_splitters_and_those_of_a_dropped_buffer_do_not(monkeypatch):
    good = protocol.reply(b"QT", "00")
    monkeypatch.setattr(sensor_line, "_SETTLE_S", 0.0)
    monkeypatch.setattr(sensor_line, "open_stream", lambda _: AsleepStream(b""))
    line = sensor_line.SensorLine("wire", protocol.LONGEST_REPLY)
    line.stream.read = lambda _: line.pieces.pop(0) if line.pieces else b""
    for lost in (1, 2):
        line.split_by(protocol.Splitter())
        line.pieces = [b"junk\n\n", good]
        assert line.next(time.monotonic() + 10.0)[0].echo == b"QT"
        assert line.bad == lost
    line.forgive()
    assert line.bad == 1  # of the first splitter
    line.pieces = [b"QT\n00", b"", b""]
    with pytest.raises(DeviceTimeoutError):
        line.receive(time.monotonic() - 1.0)
    line.drop_waiting()
    line.pieces = [good]
    assert line.next(time.monotonic() - 1.0)[0].echo == b"QT"  # not appended to the half of the dropped one
    driver = sensor_line.LineDriver()
    driver._line, driver._bad_contents = line, 2
    assert driver.bad_packets == 3


class Chatter:
    """A port on which garbage never ends."""

    def __init__(self):
        self.written, self.closed, self.noise = b"", False, itertools.cycle([b"\x00\xff", b"\n\n", b"99b\nMD"])

    def read(self, _):
        return next(self.noise)

    def write(self, data):
        self.written += data

    def close(self):
        self.closed = True


def test_endless_garbage_ends_in_a_timeout(monkeypatch):
    port = Chatter()
    monkeypatch.setattr(sensor_line, "open_stream", lambda _: port)
    monkeypatch.setattr(dialogue, "_REPLY_S", 0.02)
    with pytest.raises(DeviceTimeoutError):
        ScipLidar("somewhere")
    assert port.closed
    assert set(port.written.split()) == {b"QT"}

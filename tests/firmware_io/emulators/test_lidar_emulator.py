"""The lidar emulator: requests that real sensors were asked, an independent client, true times, every model's codes."""

import re
import socket
import time

import numpy as np
import pytest
from hokuyolx import HokuyoLX
from hypothesis import given, settings
from hypothesis import strategies as st

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar as Lidar
from scanwright.design.errors import DeviceError
from scanwright.firmware_io.emulators.hokuyo_models import IDENTITIES, Quartz
from scanwright.firmware_io.emulators.lidar import hokuyo_emulator
from scanwright.firmware_io.emulators.lidar_machine import LidarMachine, clustered
from scanwright.firmware_io.lidar.scip import measurement, protocol

MS = 1_000_000


def plain(time_ns):
    return np.linspace(0.5, 5.0, time_ns.size), np.arange(time_ns.size, dtype=float)


def machine(model, ranging=plain, clock_ms=0, **options):
    return LidarMachine(IDENTITIES[model], ranging, Quartz(0, clock_ms, 0.0), **options)


def asked(sensor, request, now_ns=0):
    (told,) = protocol.Splitter().feed(sensor.answer(request, now_ns))
    return told


def scanned(sensor):
    (told,) = protocol.Splitter().feed(sensor.next_scan())
    return measurement.measurement(told)


@pytest.mark.parametrize("name", ["urg_04lx", "utm_30lx", "uxm_30lx_e"])
def test_captured_requests_get_the_captured_bytes(data, name):
    captured = (data / "scip" / f"{name}.rx").read_bytes()
    requests = (data / "scip" / f"{name}.tx").read_bytes().split()
    scan = measurement.measurement(protocol.Splitter().feed(captured)[-1])
    model = next(model for model in IDENTITIES if model.lower().replace("-", "_") == name)
    # The numbers of the capture as ranges: those below the least range are the codes that the emulator does not choose.
    range_m = np.where(scan.value == IDENTITIES[model].no_return, np.inf, scan.value / 1000)
    sensor = machine(model, lambda _: (range_m, np.resize(scan.intensity, range_m.size)), scan.stamp_ms, laser=True)
    came = b""
    for request in requests:
        came += sensor.answer(request, 60 * MS)
        while sensor.next_ns() < 1 << 60:
            sensor.quartz = Quartz(sensor.next_ns() - sensor.arc_ns, scan.stamp_ms, 0.0)
            came += sensor.next_scan()
    ours, theirs = came.split(b"\n\n"), captured.split(b"\n\n")
    for told, real in zip(ours, theirs, strict=True):
        if real.startswith(b"TM1") or b"TIME:" in real:
            # The clock of another day; and the UXM, asked again after TM, told another mode.
            shape = rb"TIME:[0-9A-F]{6};.|MESM:[^;]*;.|(?<=00P\n)[0-o]{5}"
            assert re.sub(shape, b"", told) == re.sub(shape, b"", real)
        elif real[:1] != b"G":
            assert told == real
        else:
            assert [len(line) for line in told.split(b"\n")] == [len(line) for line in real.split(b"\n")]
            (mine,) = protocol.Splitter().feed(told + b"\n\n")
            valid = scan.value >= IDENTITIES[model].parameters.range_min_mm
            np.testing.assert_array_equal(measurement.measurement(mine).value[valid], scan.value[valid])
            assert mine.echo + b"\n00P" == real[: len(mine.echo) + 4]


@pytest.mark.parametrize(
    ("once", "endless", "payload"),
    [
        (b"HD0000000201", b"ND0000000201000", b"0CB0?X&0O@001"),
        (b"HE0000000201", b"NE0000000201000", b"0CB01T0?X01U&0O@01W001000"),
    ],
)
def test_all_echoes_of_a_beam_follow_each_other(once, endless, payload):
    """As urg_library 328b452 reads them: 1234 mm; 1000 and 2000 mm; nothing. Intensities from 100 on."""
    range_m = np.full((2, 1081), np.inf)
    range_m[:, 0], range_m[:, 1] = (1.234, np.inf), (1.0, 2.0)
    bright = np.where(np.isfinite(range_m), 100.0 + np.array([[0], [2]]) + np.arange(1081), np.nan)
    sensor = machine("UTM-30LX-EW", lambda _: (range_m, bright), laser=True)
    assert asked(sensor, once).lines[1] == payload
    assert sensor.answer(endless, 0) == endless + b"\n00P\n\n"
    assert sensor.next_scan().split(b"\n")[::3] == [endless, protocol.summed(payload)]


def test_the_models_are_those_of_the_catalogue():
    catalogue, shared = load_catalogue(), set()
    for model, identity in IDENTITIES.items():
        if model in catalogue.products:
            product, of = catalogue.get(model, Lidar), identity.parameters
            shared.add(model)
            assert (product.first_step, product.last_step, product.front_step, product.steps_per_turn) == (
                of.first_step,
                of.last_step,
                of.front_step,
                of.steps_per_turn,
            )
            assert product.scan_rate_hz == pytest.approx(1 / of.scan_period_s)
    assert shared == {one.name for one in catalogue if isinstance(one, Lidar) and one.family == "scip"}
    with pytest.raises(DeviceError, match="did you mean 'UTM-30LX'"):
        hokuyo_emulator("UTM30LX", plain)


@pytest.mark.parametrize(
    ("model", "request_", "status"),
    [
        ("UTM-30LX", b"MD0000108101000", "04"),
        ("UTM-30LX", b"MD0100001001000", "05"),
        ("UTM-30LX", b"GD0000108001", "10"),
        ("UTM-30LX", b"MD0000108001", "0C"),
        ("UTM-30LX", b"TM1", "04"),
        ("UTM-30LX", b"TM2", "03"),
        ("UTM-30LX", b"TM7", "01"),
        ("UTM-30LX", b"XX", "0E"),
        ("UTM-30LX", b"CR00", "04"),
        ("URG-04LX", b"CR00", "03"),
        ("URG-04LX", b"ME0044072501000", "0E"),
        ("UTM-30LX", b"ND0000108001000", "0E"),
        ("UTM-30LX-EW", b"NS0000108001000", "0E"),
        ("UTM-30LX-EW", b"HD0000108001", "10"),
        ("URG-04LX", b"SS115200", "00"),
        ("URG-04LX", b"VV;more than sixteen letters", "0G"),
    ],
)
def test_refusals(model, request_, status):
    assert machine(model).answer(request_, 0).split(b"\n")[1] == protocol.summed(status.encode())


def test_laser_time_and_reset_are_states():
    sensor = machine("UTM-30LX", clock_ms=(1 << 24) - 5)
    assert [asked(sensor, b"BM").status, asked(sensor, b"BM").status] == ["00", "02"]
    assert asked(sensor, b"TM0").status == "00"
    assert not sensor.laser
    assert [measurement.stamp(asked(sensor, b"TM1", now * MS)) for now in (0, 4, 5, 6)] == [
        (1 << 24) - 5,
        (1 << 24) - 1,
        0,
        1,
    ]
    assert asked(sensor, b"VV").status == "0E"  # nothing else while it adjusts its time
    assert asked(sensor, b"TM2").status == "00"
    assert asked(sensor, b"RS", 100 * MS).status == "00"
    assert protocol.information(asked(sensor, b"II", 110 * MS))["TIME"] == "00000A"
    assert [asked(sensor, b"RB").status, asked(sensor, b"RB", 200 * MS).status] == ["01", "00"]
    assert sensor.answer(b"VV", 300 * MS) == b""  # it boots
    assert asked(sensor, b"VV", 1300 * MS).status == "00"


def test_scip_1_until_it_is_stepped_up():
    sensor = machine("URG-04LX", scip_1=True)
    assert sensor.answer(b"QT", 0) == b"QT\nE\n\n"
    assert sensor.answer(b"SCIP2.0", 0) == b"SCIP2.0\n0\n\n"
    assert asked(sensor, b"QT").status == "00"


def test_scans_count_down_carry_the_text_and_put_the_laser_out():
    sensor = machine("UTM-30LX")
    assert asked(sensor, b"MD0000000902103;hello").status == "00"
    echoes, stamps = [], []
    while sensor.next_ns() < 1 << 60:
        for told in protocol.Splitter().feed(sensor.next_scan()):
            echoes.append(told.echo)
            stamps.append(measurement.measurement(told).stamp_ms)
    assert echoes == [b"MD00000009021%02d;hello" % left for left in (2, 1, 0)]
    assert np.diff(stamps).tolist() == [50, 50]  # one of two is left out
    assert not sensor.laser


@pytest.mark.parametrize("convention", ["step_0", "rear"])
def test_beams_are_seen_at_their_true_times(convention):
    seen = []
    sensor = machine("URG-04LX", lambda t: (seen.append(t), plain(t))[1], stamp_at=convention, motor_error=1e-3)
    asked(sensor, b"MD0044072501000", 7 * MS)
    taken = scanned(sensor)
    period_ns = 0.1 * 1.001 * 1e9
    turn_ns = period_ns  # the first turn that begins after the request
    expected = turn_ns + np.arange(44, 726) * period_ns / 1024
    np.testing.assert_allclose(seen[0], expected, atol=1)
    rear_ns = (512 - 384) / 1024 * period_ns if convention == "rear" else 0  # the rear is passed before step 0
    assert taken.stamp_ms == int((turn_ns - rear_ns) // MS)


@pytest.mark.parametrize(
    ("model", "lost", "near"),
    [("URG-04LX", 0, 6), ("UTM-30LX", 1, 2), ("UXM-30LX-E", 0, 0), ("UST-10LX", 65533, 65533)],
)
def test_ranges_are_millimetres_or_the_models_codes(model, lost, near):
    given_m = [np.inf, np.nan, 1e3, -np.inf, 0.004, 1.23449, 1.2346]

    def look(time_ns):
        return np.resize(given_m, time_ns.size), np.full(time_ns.size, 3e5)

    sensor = machine(model, look)
    of = IDENTITIES[model].parameters
    letter = b"ME" if IDENTITIES[model].intensity else b"MD"
    assert asked(sensor, letter + b"%04d%04d01000" % (of.first_step, of.last_step)).status == "00"
    taken = scanned(sensor)
    assert taken.value[:7].tolist() == [lost, lost, lost, near, near, 1234, 1235]
    assert set(taken.intensity) <= {(1 << 18) - 1}


@given(
    value=st.lists(st.integers(0, 60), min_size=1, max_size=40),
    cluster=st.integers(1, 12),
)
@settings(max_examples=100)
def test_a_cluster_is_its_least_range_that_is_none_of_the_codes(value, cluster):
    expected = []
    for begin in range(0, len(value), cluster):
        group = value[begin : begin + cluster]
        expected.append(min([v for v in group if v >= 20], default=group[0]))
    assert clustered(np.array(value), cluster, 20).tolist() == expected


def test_an_independent_client_cannot_tell_it_from_hardware():
    with hokuyo_emulator("UST-10LX", plain) as emulator:
        host, port = emulator.address.split(":")
        client = HokuyoLX(addr=(host, int(port)), tsync=False, timeout=20, convert_time=False)
        try:
            assert client.model.startswith("UST-10LX")
            assert client.version()["PROT"] == "SCIP 2.0"
            assert client.sensor_state()["LASR"] == "ON"
            assert client.laser_state()[0] == 3
            expected = np.rint(np.linspace(0.5, 5.0, 1081) * 1000)
            np.testing.assert_array_equal(client.get_dist()[1], expected)
            stamps = []
            # It takes replies that come in one piece for one reply: leave it time between two scans.
            for scan, stamp, _ in client.iter_dist(3, skips=9):
                np.testing.assert_array_equal(scan, expected)
                stamps.append(stamp)
            assert set(np.diff(stamps)) <= {250, 251}
            client.activate()
            for scan, _, _ in client.iter_intens(2, start=10, end=100, grouping=1, skips=9):
                np.testing.assert_array_equal(scan[:, 0], expected[10:101])
                np.testing.assert_array_equal(scan[:, 1], np.arange(10, 101))
            client.tsync_enter()
            first, second = client.tsync_get(), client.tsync_get()
            client.tsync_exit()
            assert 0 <= second - first < 1000
            client.reset()
            assert client.laser_state()[0] == 0
        finally:
            client.close()


def test_scans_arrive_late_and_in_order_but_never_early():
    begun = []

    def look(time_ns):
        begun.append(int(time_ns[0]))
        return plain(time_ns)

    with hokuyo_emulator("UTM-30LX", look, jitter_s=0.02) as emulator:
        host, port = emulator.address.split(":")
        with socket.create_connection((host, int(port)), timeout=20) as client:
            client.sendall(b"MD0000000401000\n")
            splitter, arrivals = protocol.Splitter(), []
            while len(arrivals) < 25:
                arrivals += [
                    time.monotonic_ns() for told in splitter.feed(client.recv(4096)) if measurement.is_scan(told)
                ]
    late_ms = (np.array(arrivals[:25]) - np.array(begun[:25]) - emulator.machine.arc_ns) / MS
    assert late_ms.min() >= 0
    assert 3 < np.median(late_ms)  # evenly spread to 20 ms, and more where the machine is busy
    assert emulator.machine.arc_ns == pytest.approx(1081 / 1440 * 25.05 * MS, abs=1)


def test_a_look_that_fails_is_told_at_the_end():
    def look(_):
        raise ZeroDivisionError("no scene")

    emulator = hokuyo_emulator("UTM-30LX", look, scanning=True)
    with pytest.raises(ZeroDivisionError), emulator:
        emulator._thread.join(timeout=60)
        assert not emulator._thread.is_alive()


def test_a_slow_look_leaves_scans_out_and_blocks_nothing():
    sensor = machine("UTM-30LX", motor_error=0.0)
    asked(sensor, b"MD0000108001000", 1)
    assert scanned(sensor).stamp_ms == 25
    sensor.skip_to(1000 * MS)
    assert sensor.next_ns() <= 1025 * MS
    assert scanned(sensor).stamp_ms >= 950

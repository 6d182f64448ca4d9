"""RPLIDARs: bytes against published ones, the driver against the emulator, whatever breaks on the way."""

import socket
import struct
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from patience import until

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import DeviceError, ProtocolError
from scanwright.firmware_io.emulators import world
from scanwright.firmware_io.emulators.slamtec.machine import slamtec_emulator
from scanwright.firmware_io.emulators.slamtec.models import IDENTITIES
from scanwright.firmware_io.lidar.families import open_lidar
from scanwright.firmware_io.lidar.slamtec import dialogue, driver, protocol

# What the maker's protocol manual and SDK write.
REQUESTS = [
    (protocol.INFO, b"", "A5 50"),
    (protocol.HEALTH, b"", "A5 52"),
    (protocol.SCAN, b"", "A5 20"),
    (protocol.EXPRESS_SCAN, bytes(5), "A5 82 05 00 00 00 00 00 22"),
    (protocol.MOTOR_PWM, b"\x94\x02", "A5 F0 02 94 02 C1"),
    (protocol.MOTOR_PWM, bytes(2), "A5 F0 02 00 00 57"),
    (protocol.MOTOR_RPM, b"\x58\x02", "A5 A8 02 58 02 55"),
    (protocol.GET_CONF, b"\x70\0\0\0", "A5 84 04 70 00 00 00 55"),
    (protocol.GET_CONF, b"\x7c\0\0\0", "A5 84 04 7C 00 00 00 59"),
]
DESCRIPTORS = [
    ("A5 5A 14 00 00 00 04", protocol.Descriptor(20, False, 0x04)),
    ("A5 5A 03 00 00 00 06", protocol.Descriptor(3, False, 0x06)),
    ("A5 5A 04 00 00 00 15", protocol.Descriptor(4, False, 0x15)),
    ("A5 5A 05 00 00 40 81", protocol.Descriptor(5, True, 0x81)),
    ("A5 5A 54 00 00 40 82", protocol.Descriptor(84, True, 0x82)),
]


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """Emulators share a computer with the tests: wait ten times as long."""
    monkeypatch.setattr(dialogue, "_REPLY_S", 2.0)
    monkeypatch.setattr(driver, "_START_S", 20.0)
    monkeypatch.setattr(driver, "_PAUSE_S", 2.0)  # what is lost after one is for `test_stalls`
    monkeypatch.setattr(world, "SPIN_UP_S", 1e-6)  # what happens meanwhile is for `test_spin_up`


def lidar(model):
    return load_catalogue().products[model]


def wall_m(bearing_rad):
    return 2.0 + np.sin(bearing_rad)


def rounded_m(model):
    """Ultra capsules have steps of 4 mm from 2 m on, ultra-dense ones of 3 mm."""
    return 5e-3 if " A" in model else 3e-3 if model == "RPLIDAR S3" else 1.5e-3


def ranging(time_ns, bearing_rad):
    gap = np.abs(np.remainder(bearing_rad + np.pi, 2 * np.pi) - np.pi) > 3.0
    return np.where(gap, np.inf, wall_m(bearing_rad)), np.full(time_ns.size, 800.0)


# Bytes


@pytest.mark.parametrize(("command", "payload", "published"), REQUESTS)
def test_requests_are_those_that_are_published(command, payload, published):
    assert protocol.request(command, payload) == bytes.fromhex(published)


@pytest.mark.parametrize(("published", "told"), DESCRIPTORS)
def test_descriptors_are_those_that_are_published(published, told):
    assert protocol.descriptor(bytes.fromhex(published)) == told


def test_a_emulator_answers_published_requests_with_published_descriptors():
    emulator = slamtec_emulator(lidar("RPLIDAR A1"), ranging)
    for request, published, size in (("A5 50", DESCRIPTORS[0], 20), ("A5 52", DESCRIPTORS[1], 3)):
        told, rest = emulator.machine.receive(bytes.fromhex(request), emulator.machine.began_ns)
        assert told[:7] == bytes.fromhex(published[0]) and (len(told), rest) == (7 + size, b"")
    wrong, _ = emulator.machine.receive(bytes.fromhex("A5 82 05 00 00 00 00 00 23"), emulator.machine.began_ns)
    assert wrong == b""


# What ultra_simple of rplidar_sdk 2.1 sends to an A1 and an S2, and the answers that it needs.
SDK_DIALOGUES = {
    "RPLIDAR A1": [
        ("A5 50", "A5 5A 14 00 00 00 04 18 1D 01 07"),
        ("A5 52", "A5 5A 03 00 00 00 06 00 00 00"),
        ("A5 84 04 01 00 00 00 24", "A5 5A 08 00 00 00 20 01 00 00 00 58 02 94 02"),
        ("A5 84 04 7C 00 00 00 59", "A5 5A 06 00 00 00 20 7C 00 00 00 03 00"),
        ("A5 84 06 71 00 00 00 03 00 55", "A5 5A 08 00 00 00 20 71 00 00 00 00 7F 00 00"),
        ("A5 84 06 74 00 00 00 03 00 50", "A5 5A 08 00 00 00 20 74 00 00 00 00 0C 00 00"),
        ("A5 84 06 75 00 00 00 03 00 51", "A5 5A 05 00 00 00 20 75 00 00 00 84"),
        ("A5 84 06 7F 00 00 00 03 00 5B", "A5 5A 10 00 00 00 20 7F 00 00 00" + b"Sensitivity\0".hex()),
        ("A5 82 05 03 00 00 00 00 21", "A5 5A 84 00 00 40 84"),
        ("A5 25", ""),
        ("A5 21", "A5 5A 05 00 00 40 81"),
    ],
    "RPLIDAR S2": [
        ("A5 84 04 7C 00 00 00 59", "A5 5A 06 00 00 00 20 7C 00 00 00 01 00"),
        ("A5 84 06 71 00 00 00 01 00 57", "A5 5A 08 00 00 00 20 71 00 00 00 40 1F 00 00"),
        ("A5 84 06 75 00 00 00 01 00 53", "A5 5A 05 00 00 00 20 75 00 00 00 85"),
        ("A5 A8 02 58 02 55", ""),
        ("A5 82 05 01 00 00 00 00 23", "A5 5A 54 00 00 40 85"),
        ("A5 84 06 71 00 00 00 07 00 51", ""),
    ],
    "RPLIDAR A3": [("A5 FF 04 00 00 00 00 5E", "A5 5A 04 00 00 00 FF 01 00 00 00"), ("A5 F0 02 94 02 C1", "")],
}


@pytest.mark.parametrize("model", sorted(SDK_DIALOGUES))
def test_an_emulator_answers_what_the_makers_program_asks(model):
    emulator = slamtec_emulator(lidar(model), ranging)
    for request, answer in SDK_DIALOGUES[model]:
        got, rest = emulator.machine.receive(bytes.fromhex(request), emulator.machine.began_ns)
        assert got[: len(bytes.fromhex(answer))] == bytes.fromhex(answer), request
        assert bool(got) == bool(answer) and rest == b""


def test_a_serial_line_sends_no_faster_than_it_can():
    for model, identity in IDENTITIES.items():
        emulator = slamtec_emulator(lidar(model), ranging)
        for number, mode in enumerate(identity.modes):
            command = protocol.SCAN if mode.kind == protocol.NODES else protocol.EXPRESS_SCAN
            request = protocol.request(command, bytes([number, 0, 0, 0, 0]))
            emulator.machine.receive(request, emulator.machine.began_ns)
            sent = [one for _ in range(60) for one in emulator.machine.next_packets()]
            bytes_s = sum(len(data) for _, data in sent[1:]) * 1e9 / (sent[-1][0] - sent[0][0])
            assert bytes_s < 1.0001 * identity.baud / 10, (model, mode.name)


def test_old_firmware_streams_express_capsules():
    """Before 1.24 it does not answer GET_LIDAR_CONF; it states the time between two points instead."""
    with slamtec_emulator(lidar("RPLIDAR A1"), ranging) as emulator:
        emulator.machine.identity = replace(IDENTITIES["RPLIDAR A1"], firmware=(1, 20), modes=())
        with open_lidar(emulator.port, "RPLIDAR A1") as ours:
            ours.start()
            assert ours.firmware == "1.20" and 680 < ours.read().scan.range_m.size < 760


def test_a_node_is_read_by_its_bits():
    # quality 15, a new turn, 90 deg, 1234.5 mm
    angle = 90 * 64 << 1 | 1
    data = bytes([15 << 2 | 1, angle & 255, angle >> 8, 4938 & 255, 4938 >> 8])
    packet = protocol.node(data)
    assert (packet.start_deg, packet.first, packet.quality[0]) == (90.0, True, 15)
    assert packet.range_m[0] == np.float32(1.2345)
    for broken in (bytes([data[0] ^ 2]) + data[1:], data[:1] + bytes([data[1] ^ 1]) + data[2:], data[:4]):
        with pytest.raises(ProtocolError):
            protocol.node(broken)


def test_a_cabin_is_read_by_its_bits():
    # 1000 mm with +2.5 deg (20 eighths: 01 0100), 2000 mm with -1 deg (-8: 11 1000); start 350.5 deg, the first
    cabin = (1000 << 2 | 0b01).to_bytes(2, "little") + (2000 << 2 | 0b11).to_bytes(2, "little") + bytes([0b1000_0100])
    body = (round(350.5 * 64) | 0x8000).to_bytes(2, "little") + cabin * 16
    total = int(np.bitwise_xor.reduce(np.frombuffer(body, np.uint8)))
    packet = protocol.capsule(bytes([0xA0 | total & 15, 0x50 | total >> 4]) + body)
    assert (packet.start_deg, packet.first) == (350.5, True)
    np.testing.assert_array_equal(packet.range_m[:2], np.float32([1.0, 2.0]))
    np.testing.assert_array_equal(packet.offset_deg[:4], [2.5, -1.0, 2.5, -1.0])


def test_a_pair_of_an_ultra_dense_capsule_is_read_by_its_bits():
    # Two bits of scale, then 10, 11, 12 or 13 of the range in steps of 2, 3, 4 or 5 mm, then the quality.
    pairs = [
        (0b00101000_0111110100_00, 0b0010100_00111110100_01),  # 500 * 2; 2046 + 500 * 3
        (0b001010_000111110100_10, 0b00101_1111111111111_11),  # 8187 + 500 * 4; 24567 + 8191 * 5
    ]
    cabins = b"".join(struct.pack("<HHB", a & 0xFFFF, b & 0xFFFF, a >> 16 | b >> 16 << 4) for a, b in pairs * 16)
    body = bytes(6) + (round(350.5 * 64) | 0x8000).to_bytes(2, "little") + cabins
    total = int(np.bitwise_xor.reduce(np.frombuffer(body, np.uint8)))
    packet = protocol.ultra_dense(bytes([0xA0 | total & 15, 0x50 | total >> 4]) + body)
    assert (packet.start_deg, packet.first, packet.range_m.size) == (350.5, True, 64)
    np.testing.assert_array_equal(packet.range_m[:4], np.float32([1.0, 3.546, 10.187, 65.522]))
    np.testing.assert_array_equal(packet.quality[:4], 40)


def stream_of(model, mode, turns=0.3):
    emulator = slamtec_emulator(lidar(model), ranging)
    start = protocol.request(protocol.EXPRESS_SCAN, bytes([mode, 0, 0, 0, 0]))
    emulator.machine.receive(start, emulator.machine.began_ns)
    data = b""
    while len(data) < 84 * 12 * turns:
        data += b"".join(packet for _, packet in emulator.machine.next_packets())
    return data


STREAMS = {  # nodes, capsules, ultra capsules, dense and ultra-dense ones
    ("RPLIDAR C1", 0): stream_of("RPLIDAR C1", 0),
    ("RPLIDAR A1", 1): stream_of("RPLIDAR A1", 1),
    ("RPLIDAR A1", 3): stream_of("RPLIDAR A1", 3),
    ("RPLIDAR S2", 1): stream_of("RPLIDAR S2", 1),
    ("RPLIDAR S3", 1): stream_of("RPLIDAR S3", 1),
}


@seed(19)
@settings(max_examples=300, deadline=None)
@given(st.sampled_from(sorted(STREAMS)), st.data())
def test_damaged_streams_give_packets_or_nothing(model, data):
    kind = IDENTITIES[model[0]].modes[model[1]].kind
    stream = bytearray(STREAMS[model])
    for _ in range(data.draw(st.integers(0, 12))):
        at = data.draw(st.integers(0, len(stream) - 1))
        what = data.draw(st.integers(0, 2))
        if what == 0:
            stream[at] = data.draw(st.integers(0, 255))
        elif what == 1:
            del stream[at : at + data.draw(st.integers(1, 60))]
        else:
            stream[at:at] = data.draw(st.binary(max_size=60))
        stream = stream or bytearray(b"\xa5")
    splitter = protocol.SlamtecSplitter(kind)
    for packet, _ in splitter.feed(bytes(stream)):
        assert packet.range_m.size == protocol.POINTS[kind] and 0 <= packet.start_deg < 360
    assert len(splitter.feed(STREAMS[model])) >= len(STREAMS[model]) // protocol.SIZES[kind] - 30


READERS = [
    protocol.descriptor,
    protocol.info,
    protocol.health,
    protocol.node,
    protocol.capsule,
    protocol.ultra,
    protocol.dense,
    protocol.ultra_dense,
]


@seed(19)
@settings(max_examples=300)
@given(st.sampled_from(READERS), st.binary())
def test_anything_is_an_answer_or_a_typed_error(read, data):
    with suppress(ProtocolError):
        read(data)


# The driver


@pytest.mark.parametrize("model", sorted(IDENTITIES))
def test_turns_come_as_they_were_seen(model):
    with slamtec_emulator(lidar(model), ranging) as emulator:
        with open_lidar(emulator.port, model) as ours:
            assert (
                ours.model == model
                and ours.firmware == "{}.{:02d}".format(*IDENTITIES[model].firmware)
                and len(ours.serial_number) == 32
            )
            ours.start(intensity=True)
            timed = [ours.read() for _ in range(5)]
            steps = np.diff([one.scan.stamp_ns for one in timed]) * lidar(model).scan_rate_hz / 1e9
            missing = np.rint(steps - 1).sum()  # on a busy computer the emulator leaves some out
            assert ours.bad_packets == 0 and abs(ours.dropped - missing) <= 1
        until(lambda: emulator.machine.scanning is None)  # `with` puts it out
    usual = 1e6 / IDENTITIES[model].usual.point_us / lidar(model).scan_rate_hz
    assert usual > 0.98 * lidar(model).steps_per_turn
    for one in timed:
        scan = one.scan
        assert 0.9 * usual < scan.range_m.size < 1.1 * usual
        lost = np.isnan(scan.range_m)
        assert 0.02 < lost.mean() < 0.07
        # angles are in sixty-fourths, and between two starts straight
        np.testing.assert_allclose(scan.range_m[~lost], wall_m(scan.bearing_rad[~lost]), atol=rounded_m(model))
        assert scan.time_ns[-1] < one.arrival_ns


def test_an_s2_may_be_an_s2l_and_an_s3_has_its_own_series():
    with slamtec_emulator(lidar("RPLIDAR S2L"), ranging) as emulator:
        with open_lidar(emulator.port, "RPLIDAR S2L") as ours:
            assert ours.model == "RPLIDAR S2L"
        with pytest.raises(DeviceError, match="this is a RPLIDAR S2 or RPLIDAR S2L, not a RPLIDAR S3"):
            open_lidar(emulator.port, "RPLIDAR S3")


def test_another_model_is_refused_and_none_named_is_found():
    with slamtec_emulator(lidar("RPLIDAR A1"), ranging) as emulator:
        with pytest.raises(DeviceError, match="this is a RPLIDAR A1, not a RPLIDAR C1"):
            open_lidar(emulator.port, "RPLIDAR C1")
        with driver.SlamtecLidar(emulator.port) as ours:
            assert ours.model == "RPLIDAR A1"


@pytest.mark.parametrize("model", ["RPLIDAR A2", "RPLIDAR S2"])
def test_bad_capsules_are_counted_and_never_handed_out(model):
    with slamtec_emulator(lidar(model), ranging) as emulator, open_lidar(emulator.port, model) as ours:
        ours.start()
        ours.read()
        emulator.garble(4)
        emulator.cut(4)
        for _ in range(4):
            scan = ours.read().scan
            seen = ~np.isnan(scan.range_m)
            np.testing.assert_allclose(scan.range_m[seen], wall_m(scan.bearing_rad[seen]), atol=rounded_m(model))
        assert 4 <= ours.bad_packets <= 20


def test_it_may_scan_already_and_comes_back_after_an_unplug_and_a_brown_out():
    with slamtec_emulator(lidar("RPLIDAR C1"), ranging) as emulator:
        emulator.machine.receive(protocol.request(protocol.SCAN), time.monotonic_ns())
        with open_lidar(emulator.port, "RPLIDAR C1") as ours:
            ours.start()
            ours.read()
            emulator.unplug()
            with pytest.raises(DeviceError):
                for _ in range(5):
                    ours.read(0.3)
            emulator.plug()
            ours.reconnect(20.0)
            assert ours.read().scan.range_m.size > 400
            emulator.power_cycle()
            with pytest.raises(DeviceError, match="nothing came in time"):
                for _ in range(9):
                    ours.read(0.1)
            ours.reconnect(20.0)
            assert ours.read().scan.range_m.size > 400


def test_a_warning_of_its_health_is_told_with_the_turns():
    with slamtec_emulator(lidar("RPLIDAR S1"), ranging) as emulator, open_lidar(emulator.port, "RPLIDAR S1") as ours:
        emulator.machine.health = 1
        ours.start()
        assert ours.read().warning == "health warning 0x8002; it still scans"
        ours.stop()
        emulator.machine.health = 0
        ours.start()
        assert not ours.read().warning


def test_a_fault_is_told():
    with slamtec_emulator(lidar("RPLIDAR S1"), ranging) as emulator, open_lidar(emulator.port, "RPLIDAR S1") as ours:
        emulator.machine.health = 2
        with pytest.raises(DeviceError, match="it reports fault 0x8002"):
            ours.start()


def test_a_server_that_says_nothing_is_not_asked_at_every_speed():
    """Its line has a speed of its own: `doctor` without a model would wait for each of the series in turn."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        with pytest.raises(DeviceError, match="no RPLIDAR answers"):
            driver.SlamtecLidar(f"127.0.0.1:{server.getsockname()[1]}")
        with server.accept()[0] as heard:
            assert heard.recv(10_000).count(protocol.request(protocol.STOP)) == 3

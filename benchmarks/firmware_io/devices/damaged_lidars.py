"""What each family of lidars says, for `benchmarks.firmware_io.fuzz`, and what has a right to be accepted of it."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scanwright.design.errors import ProtocolError
from scanwright.firmware_io.emulators import ldrobot as ldrobot_emulators
from scanwright.firmware_io.emulators.sick import lms_emulator as lms_emulators
from scanwright.firmware_io.emulators.slamtec import packets as slamtec_emulators
from scanwright.firmware_io.lidar.ldrobot import protocol as ldrobot
from scanwright.firmware_io.lidar.lms2xx import protocol as lms
from scanwright.firmware_io.lidar.scip import measurement, parameters, protocol
from scanwright.firmware_io.lidar.sick import cola, scan_data
from scanwright.firmware_io.lidar.slamtec import protocol as slamtec
from scanwright.firmware_io.lidar.slamtec.point_count import PointCount

_SCIP = [b"\n", b"\n\n", b"99b\n", b"MD0000003901000\n", b"ME0003001201000\n", b";", b"0", b"\xff"]
_COLA = [b"\x02", b"\x03", b"\x02" * 4, b"\x02sSN ", b"sFA", b" ", b"FFFFFFFF", b"\x00\x00", b"-1", b"\xff"]
_LDROBOT = [b"\x54\x2c", b"\x54", b"\x2c\x54", b"\x00" * 8, b"\xff" * 4]
_LMS = [b"\x02", b"\x02\x80", b"\x06", b"\x15", b"\xb0", b"\x02\x80\xff\xff", b"\xff"]
_SLAMTEC = [b"\xa5\x5a", b"\xa5", b"\xa5\x5a\x54\x00\x00\x40\x82", b"\xa0\x50", b"\xff" * 5, b"\x02\x01"]


def scip_dialogue(rng: random.Random) -> bytes:
    """What a sensor says: who it is, its time, and scans of several kinds with values of their own."""
    pp = [("MODL", "URG-04LX(H)"), ("DMIN", "20"), ("DMAX", "5600"), ("ARES", "1024"), ("AMIN", "44")]
    pp += [("AMAX", "725"), ("AFRT", "384"), ("SCAN", "600")]
    said = protocol.reply(b"VV", "00", protocol.text_lines([("VEND", "Hokuyo"), ("SERI", "H07")]))
    said += protocol.reply(b"PP", "00", protocol.text_lines(pp))
    said += protocol.reply(b"TM1", "00", [protocol.summed(protocol.encode([rng.randrange(1 << 24)], 4))])
    for intensity in (False, True, False):
        window = measurement.Window(first_step=3, last_step=3 + rng.randrange(40), intensity=intensity)
        values = [rng.randrange(1 << 18) for _ in range(window.size * (1 + intensity))]
        lines = protocol.data_lines(rng.randrange(1 << 24), protocol.encode(values, 3))
        said += protocol.reply(measurement.continuous(window, count=1), "99", lines)
    return said


def scip_survive(stream: bytes) -> tuple[int, int]:
    """Feed a stream in two pieces; scans accepted, and replies refused. Fails where one has no right to be there."""
    splitter, middle, accepted, refused = protocol.Splitter(), len(stream) // 2, 0, 0
    for told in [*splitter.feed(stream[:middle]), *splitter.feed(stream[middle:])]:
        for line in told.lines:
            total = 0
            for byte in line:
                total += byte
            assert line + bytes([total % 64 + 48]) in stream or line + b";" in stream, "accepted with a wrong sum"
        for read in (protocol.information, measurement.measurement, measurement.stamp):
            try:
                taken = read(told)
                if isinstance(taken, dict):
                    parameters.parameters(taken)
                elif isinstance(taken, measurement.Measurement):
                    accepted += 1
                    assert taken.value.size == taken.window.size, "a scan of another size than its echo says"
            except ProtocolError:
                refused += 1
    return accepted, refused + splitter.bad


def cola_dialogue(rng: random.Random) -> bytes:
    """What a SICK sensor says in one of its dialects: who it is, a refusal, and scans with channels of their own."""
    binary = rng.random() < 0.5
    said = [cola.Writer("sRA DeviceIdent", binary=binary).text("LMS111").text("V1.00").telegram()]
    said.append(cola.Telegram(b"sFA\x00\x04" if binary else b"sFA 4", binary))
    for channels in (1, 2):
        raw = np.array([rng.randrange(1 << 16) for _ in range(rng.randrange(1, 40))], np.uint16)
        wide = tuple(scan_data.Channel(name, 1.0, 0.0, -450_000, 5000, raw) for name in ("DIST1", "RSSI1")[:channels])
        stamp_us = rng.randrange(1 << 32)
        numbers = (rng.randrange(1 << 32), 0, 1, 2, stamp_us, stamp_us, 0, 50.0, 36_000.0, ((7, 1),))
        said.append(scan_data.telegram_of(scan_data.ScanData(*numbers, wide, ()), binary=binary))
    return b"".join(map(cola.framed, said))


def cola_survive(stream: bytes) -> tuple[int, int]:
    """As `scip_survive`, for a SICK sensor; CoLa A has no sum, so there only the frame is looked at."""
    splitter, middle, accepted, refused = cola.TelegramSplitter(), len(stream) // 2, 0, 0
    for told in [*splitter.feed(stream[:middle]), *splitter.feed(stream[middle:])]:
        total = 0
        for byte in told.payload:
            total ^= byte
        there = told.payload + bytes([total]) if told.binary else b"\x02" + told.payload + b"\x03"
        assert there in stream, "accepted with a wrong sum"
        for read in (scan_data.scan_data, cola.error_code, lambda told: told.values().text()):
            try:
                taken = read(told)
                if isinstance(taken, scan_data.ScanData):
                    accepted += 1
            except ProtocolError:
                refused += 1
    return accepted, refused + splitter.bad


def ldrobot_dialogue(rng: random.Random) -> bytes:
    """What an LDROBOT says: packets, the last of which goes over its front."""
    said = b""
    for start_deg in (rng.uniform(0, 340), 355.0):
        points = [[rng.randrange(1 << 16), rng.randrange(256)] for _ in range(12)]
        said += ldrobot_emulators.write_packet(3600, start_deg, start_deg + 8.8, rng.randrange(30_000), points)
    return said


def ldrobot_survive(stream: bytes) -> tuple[int, int]:
    """As `scip_survive`, for an LDROBOT."""
    splitter, middle, accepted = ldrobot.LdrobotSplitter(), len(stream) // 2, 0
    for packet in [*splitter.feed(stream[:middle]), *splitter.feed(stream[middle:])]:
        windows = [stream[at : at + 47] for at in range(len(stream) - 46) if stream[at : at + 2] == b"\x54\x2c"]
        stamped = [one for one in windows if int.from_bytes(one[44:46], "little") % 30_000 == packet.stamp_ms]
        assert any(ldrobot_emulators.checksum(one[:46]) == one[46] for one in stamped), "accepted with a wrong sum"
        accepted += 1
    return accepted, splitter.bad


def lms_dialogue(rng: random.Random) -> bytes:
    """Replies of an LMS 2xx: acknowledgement, type, variant, and scans in both units."""
    said = b"\x06" + lms_emulators.write_telegram(b"\xbaLMS200;30106;V02.30\x10")
    said += b"\x06" + lms_emulators.write_telegram(b"\xbb\x01\xb4\x00\x32\x00\x10")
    for unit in (0x40, 0x00):
        count = rng.randrange(1, 40)
        said += lms_emulators.write_telegram(bytes([0xB0, count, unit]) + rng.randbytes(2 * count) + b"\x10")
    return said


def lms_survive(stream: bytes) -> tuple[int, int]:
    """As `scip_survive`, for an LMS 2xx."""
    splitter, middle, accepted, refused = lms.LmsSplitter(), len(stream) // 2, 0, 0
    for told in [*splitter.feed(stream[:middle]), *splitter.feed(stream[middle:])]:
        there = lms_emulators.write_telegram(bytes([told.command]) + told.values, told.address)
        assert there in stream, "accepted with a wrong sum"
        for read in (lms.scan, lms.accepted_variant):
            try:
                accepted += isinstance(read(told), lms.LmsScan)
            except ProtocolError:
                refused += 1
    return accepted, refused + splitter.bad


def slamtec_dialogue(rng: random.Random) -> bytes:
    """What an RPLIDAR says: who it is, its health, one of its modes, and a stream in that."""
    kind = rng.choice((slamtec.NODES, slamtec.CAPSULES, slamtec.DENSE))
    said = slamtec_emulators.reply(0x04, bytes([0x41, 29, 1, 7]) + rng.randbytes(16))
    said += slamtec_emulators.reply(0x06, bytes([rng.randrange(3), 0, 0]))
    said += slamtec_emulators.reply(0x20, (0x75).to_bytes(4, "little") + bytes([kind]))
    said += slamtec_emulators.stream_begins(kind, slamtec.SIZES[kind])
    start = rng.randrange(360 * 64)
    if kind == slamtec.NODES:
        for k in range(8):
            angle = (start + 46 * k) % (360 * 64) << 1 | 1
            said += bytes([rng.randrange(64) << 2 | 2]) + angle.to_bytes(2, "little") + rng.randbytes(2)
        return said
    for k in range(3):
        word = (start + 1440 * k) % (360 * 64)
        said += slamtec_emulators.summed(bytearray(word.to_bytes(2, "little") + rng.randbytes(80)))
    return said


def slamtec_survive(stream: bytes) -> tuple[int, int]:
    """As `scip_survive`, for an RPLIDAR, up to its points with their angles; a node has two check bits for a sum."""
    replies, middle, refused = slamtec.ReplySplitter(), len(stream) // 2, 0
    points = 0
    for told, data in [*replies.feed(stream[:middle]), *replies.feed(stream[middle:])]:
        if not told.stream or told.kind not in slamtec.SIZES:
            for read in (slamtec.info, slamtec.health):
                try:
                    read(data)
                except ProtocolError:
                    refused += 1
            continue
        splitter, size = slamtec.SlamtecSplitter(told.kind), slamtec.SIZES[told.kind]
        packets = splitter.feed(data)
        for packet, _ in packets if told.kind != slamtec.NODES else ():
            windows = [data[at : at + size] for at in range(len(data) - size + 1)]
            there = [
                one for one in windows if int.from_bytes(one[2:4], "little") % (1 << 15) / 64 % 360 == packet.start_deg
            ]
            assert any(slamtec_emulators.summed(bytearray(one[2:])) == one for one in there), (
                "accepted with a wrong sum"
            )
        count = PointCount(told.kind, 1e5, 115_200)
        for placed in count.placed(packets, 1_000_000_000) if packets else ():
            assert np.all((placed.angle_deg >= 0) & (placed.angle_deg < 360)), "a point at no angle"
            points += placed.angle_deg.size
        refused += splitter.bad
    return points, refused


@dataclass(frozen=True, slots=True)
class Language:
    """One family's.

    Attributes:
        say: a dialogue with values of its own.
        receive: feeds a stream in two pieces and returns the accepted and rejected packets; fails if any is wrong.
        unit: what is counted as accepted.
        scraps: that accidents leave in it.
    """

    say: Callable[[random.Random], bytes]
    receive: Callable[[bytes], tuple[int, int]]
    unit: str
    scraps: list[bytes]


LANGUAGES = {
    "SCIP": Language(scip_dialogue, scip_survive, "scans", _SCIP),
    "CoLa": Language(cola_dialogue, cola_survive, "scans", _COLA),
    "LMS2xx": Language(lms_dialogue, lms_survive, "scans", _LMS),
    "LDROBOT": Language(ldrobot_dialogue, ldrobot_survive, "packets", _LDROBOT),
    "Slamtec": Language(slamtec_dialogue, slamtec_survive, "points", _SLAMTEC),
}

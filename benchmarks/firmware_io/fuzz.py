"""Damaged replies through both codecs: `python -m benchmarks.firmware_io.fuzz [STREAMS] [SEED]`.

STREAMS (default 1,000,000) dialogues of a lidar of each family, and as many answers of a servo in each protocol,
each with a few flipped bits, lost, doubled, swapped and foreign bytes. Whatever is raised must be one of our typed
errors, whatever is accepted must have right sums, told by loops of this file, and nothing may hang. Anything else ends
the run.
"""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable
from unittest.mock import patch

import numpy as np

from design.errors import DeviceError, ProtocolError
from firmware_io.lidar.scip import parameters, protocol
from firmware_io.lidar.sick import cola, scan_data
from firmware_io.servo.bus import bus, serial_line
from firmware_io.servo.bus.bus import ServoBus
from firmware_io.servo.bus.packet_format import PacketFormat
from firmware_io.servo.bus.registers import Register
from firmware_io.servo.dynamixel.packets import PROTOCOL_1, PROTOCOL_2
from firmware_io.servo.feetech.packets import STS
from firmware_io.twins.servo import dynamixel_packets, feetech_packets

_SCIP_SCRAPS = [b"\n", b"\n\n", b"99b\n", b"MD0000003901000\n", b"ME0003001201000\n", b";", b"0", b"\xff"]
_COLA_SCRAPS = [b"\x02", b"\x03", b"\x02" * 4, b"\x02sSN ", b"sFA", b" ", b"FFFFFFFF", b"\x00\x00", b"-1", b"\xff"]
_SERVO_SCRAPS = [b"\xff\xff\x01\x02", b"\xff\xff\xfd\x00\x01", b"\xff\xff\xff", b"\x00", b"\xfd", b"\xfe"]
_BLOCK = Register(36, 8)

Statuses = Callable[[int, bytes], tuple[bytes, ...]]  # as a servo sends it, and others of the same meaning


def damaged(rng: random.Random, stream: bytes, scraps: list[bytes], accidents: int, longest: int) -> bytes:
    """The stream after some accidents, each to so many bytes at the most."""
    data = bytearray(stream)
    for _ in range(rng.randint(1, accidents)):
        at, run = rng.randrange(len(data) + 1), rng.randint(1, longest)
        match rng.randrange(7):
            case 0 if at < len(data):
                data[at] ^= 1 << rng.randrange(8)
            case 1:
                del data[at : at + run]
            case 2:
                data[at:at] = data[at : at + run]
            case 3:
                data[at:at] = rng.randbytes(run)
            case 4:
                data[at : at + run] = rng.choice(scraps)
            case 5:
                del data[at:]
            case _:
                other = rng.randrange(len(data) + 1)
                data[at : at + run], data[other : other + run] = data[other : other + run], data[at : at + run]
    return bytes(data)


def dialogue(rng: random.Random) -> bytes:
    """What a sensor says: who it is, its time, and scans of several kinds with values of their own."""
    pp = [("MODL", "URG-04LX(H)"), ("DMIN", "20"), ("DMAX", "5600"), ("ARES", "1024"), ("AMIN", "44")]
    pp += [("AMAX", "725"), ("AFRT", "384"), ("SCAN", "600")]
    said = protocol.reply(b"VV", "00", protocol.text_lines([("VEND", "Hokuyo"), ("SERI", "H07")]))
    said += protocol.reply(b"PP", "00", protocol.text_lines(pp))
    said += protocol.reply(b"TM1", "00", [protocol.summed(protocol.encode([rng.randrange(1 << 24)], 4))])
    for intensity in (False, True, False):
        window = protocol.Window(first_step=3, last_step=3 + rng.randrange(40), intensity=intensity)
        values = [rng.randrange(1 << 18) for _ in range(window.size * (1 + intensity))]
        lines = protocol.data_lines(rng.randrange(1 << 24), protocol.encode(values, 3))
        said += protocol.reply(protocol.continuous(window, count=1), "99", lines)
    return said


def survive(stream: bytes) -> tuple[int, int]:
    """Feed a stream in two pieces; scans accepted, and replies refused. Fails where one has no right to be there."""
    splitter, middle, accepted, refused = protocol.Splitter(), len(stream) // 2, 0, 0
    for told in [*splitter.feed(stream[:middle]), *splitter.feed(stream[middle:])]:
        for line in told.lines:
            total = 0
            for byte in line:
                total += byte
            assert line + bytes([total % 64 + 48]) in stream or line + b";" in stream, "accepted with a wrong sum"
        for read in (protocol.information, protocol.measurement, protocol.stamp):
            try:
                taken = read(told)
                if isinstance(taken, dict):
                    parameters.parameters(taken)
                elif isinstance(taken, protocol.Measurement):
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
    """As `survive`, for a SICK sensor; CoLa A has no sum, so there only the frame is looked at."""
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


class Wire:
    """What a serial port is to the bus; `answer` is what comes back for any request."""

    def __init__(self) -> None:
        self.answer, self._pending = b"", b""
        self.baudrate, self.is_open, self.timeout = 4_000_000, True, None

    def write(self, data: bytes) -> int:
        """Keep the answer ready; the byte that looks for an echo gets none."""
        self._pending += b"" if data == b"\0" else self.answer
        return len(data)

    def read(self, length: int) -> bytes:
        """Some of it."""
        taken, self._pending = self._pending[:length], self._pending[length:]
        return taken

    def reset_input_buffer(self) -> None:
        """Drop what was not read."""
        self._pending = b""

    def close(self) -> None:
        """Nothing to do."""


def plain(error: int, data: bytes) -> bytes:
    """A status of protocol 2.0 without its stuffing: no servo sends it, but an accident may, with a right sum."""
    body = bytes([0x55, error]) + data
    packet = b"\xff\xff\xfd\x00\x01" + (len(body) + 2).to_bytes(2, "little") + body
    return packet + dynamixel_packets.crc16(packet).to_bytes(2, "little")


def lidar(
    streams: int,
    seed: int,
    language: str,
    say: Callable[[random.Random], bytes],
    hear: Callable[[bytes], tuple[int, int]],
    scraps: list[bytes],
) -> None:
    """Damage dialogues, and print what became of them."""
    rng, accepted, refused, slowest_s = random.Random(seed), 0, 0, 0.0
    began_s = time.perf_counter()
    for k in range(streams):
        stream = damaged(rng, say(rng), scraps, 4, 70)
        fed_s = time.perf_counter()
        try:
            good, bad = hear(stream)
        except BaseException:
            print(f"{language} stream {k} of seed {seed}: {stream!r}")
            raise
        slowest_s = max(slowest_s, time.perf_counter() - fed_s)
        accepted, refused = accepted + good, refused + bad
    print(
        f"{streams:,} damaged dialogues of a lidar, {language}: {accepted:,} scans accepted, all with right sums; "
        f"{refused:,} replies refused with a typed error; slowest {1e3 * slowest_s:.0f} ms; "
        f"{time.perf_counter() - began_s:.0f} s"
    )


def servo(answers: int, seed: int, packets: PacketFormat, statuses: Statuses) -> None:
    """Damage answers to one read of a block, and print what became of them."""
    rng, wire = random.Random(seed), Wire()
    with (
        patch.object(serial_line, "open_serial_port", lambda *_: wire),
        patch.object(serial_line.SerialLine, "wait_s", 0.0002),
        patch.object(bus, "_TRIES", 1),
    ):
        servo_bus, accepted, slowest_s, began_s = ServoBus("wire", packets), 0, 0.0, time.perf_counter()
        for k in range(answers):
            data = bytes(rng.choice((0, 1, 0x55, 0xFD, 0xFF)) for _ in range(_BLOCK.size))
            wire.answer = damaged(rng, statuses(0, data)[0], _SERVO_SCRAPS, 2, 4)
            asked_s = time.perf_counter()
            try:
                answer = servo_bus.read(1, _BLOCK)
                accepted += 1
                whole = (packet for error in range(256) for packet in statuses(error, answer.data))
                assert any(packet in wire.answer for packet in whole), "accepted with a wrong sum"
            except DeviceError:
                pass
            except BaseException:
                print(f"servo answer {k} of seed {seed}, protocol {packets.protocol}: {wire.answer!r}")
                raise
            slowest_s = max(slowest_s, time.perf_counter() - asked_s)
    print(
        f"{answers:,} damaged answers of a servo, protocol {packets.protocol}: "
        f"{accepted:,} accepted, all with right sums; {answers - accepted:,} "
        f"refused with a typed error; slowest {1e3 * slowest_s:.0f} ms; {time.perf_counter() - began_s:.0f} s"
    )


def main() -> None:
    """All of them."""
    streams = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    lidar(streams, seed, "SCIP", dialogue, survive, _SCIP_SCRAPS)
    lidar(streams, seed, "CoLa", cola_dialogue, cola_survive, _COLA_SCRAPS)
    servo(streams, seed, PROTOCOL_1, lambda error, data: (dynamixel_packets.status("1.0", 1, error, data),))
    servo(
        streams,
        seed,
        PROTOCOL_2,
        lambda error, data: (dynamixel_packets.status("2.0", 1, error, data), plain(error, data)),
    )
    servo(streams, seed, STS, lambda error, data: (feetech_packets.status(1, error, data),))


if __name__ == "__main__":
    main()

"""Damaged replies through every codec: `python -m benchmarks.firmware_io.fuzz [STREAMS] [SEED] [PROTOCOL...]`.

STREAMS (default 1,000,000) dialogues of a lidar of each family, and as many answers of a servo in each protocol (or
of those that are named: SCIP, CoLa, LMS2xx, LDROBOT, Slamtec, "servo 1.0", "servo 2.0", "servo STS"),
each with a few flipped bits, lost, doubled, swapped and foreign bytes. Whatever is raised must be one of our typed
errors, whatever is accepted must have right sums, told by loops of these files, and nothing may hang. Anything else
ends the run.
"""

from __future__ import annotations

import random
import sys
import time
from collections.abc import Callable
from unittest.mock import patch

from benchmarks.firmware_io.devices.damaged_lidars import LANGUAGES
from scanwright.design.errors import DeviceError
from scanwright.firmware_io.emulators.servo import dynamixel_packets
from scanwright.firmware_io.servo.bus import bus, serial_line
from scanwright.firmware_io.servo.bus.bus import ServoBus
from scanwright.firmware_io.servo.bus.packet_format import PacketFormat
from scanwright.firmware_io.servo.bus.registers import Register
from scanwright.firmware_io.servo.dynamixel.packets import PROTOCOL_1, PROTOCOL_2
from scanwright.firmware_io.servo.feetech.packets import STS

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


def in_stream(statuses: Statuses, stream: bytes, data: bytes) -> bool:
    """Whether one of those that bring this data is in the stream."""
    return any(packet in stream for error in range(256) for packet in statuses(error, data))


def lidar(streams: int, seed: int, name: str) -> None:
    """Damage dialogues, and print what became of them."""
    language = LANGUAGES[name]
    rng, accepted, refused, slowest_s = random.Random(seed), 0, 0, 0.0
    began_s = time.perf_counter()
    for k in range(streams):
        stream = damaged(rng, language.say(rng), language.scraps, 4, 70)
        fed_s = time.perf_counter()
        try:
            good, bad = language.receive(stream)
        except BaseException:
            print(f"{name} stream {k} of seed {seed}: {stream!r}")
            raise
        slowest_s = max(slowest_s, time.perf_counter() - fed_s)
        accepted, refused = accepted + good, refused + bad
    print(
        f"{streams:,} damaged dialogues, {name}: {accepted:,} {language.unit} accepted, all with right sums; "
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
                assert in_stream(statuses, wire.answer, answer.data), "accepted with a wrong sum"
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


SERVOS: dict[str, tuple[PacketFormat, Statuses]] = {
    "servo 1.0": (PROTOCOL_1, lambda error, data: (dynamixel_packets.status("1.0", 1, error, data),)),
    "servo 2.0": (
        PROTOCOL_2,
        lambda error, data: (dynamixel_packets.status("2.0", 1, error, data), plain(error, data)),
    ),
    "servo STS": (STS, lambda error, data: (dynamixel_packets.status("1.0", 1, error, data),)),
}


def main() -> None:
    """All of them, or those that are named."""
    streams = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    for name in sys.argv[3:] or [*LANGUAGES, *SERVOS]:
        if name in LANGUAGES:
            lidar(streams, seed, name)
        else:
            servo(streams, seed, *SERVOS[name])


if __name__ == "__main__":
    main()

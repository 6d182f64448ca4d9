"""Requests to an RPLIDAR, its replies, and the choice of its scan mode; failures raise DeviceError."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TypeVar

from scanwright.design.errors import DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.lidar.sensor_line import SensorLine
from scanwright.firmware_io.lidar.slamtec import protocol

_REPLY_S = 0.5  # the SDK waits 2 s, long for a silent port
Answer = TypeVar("Answer")


class SlamtecDialogue:
    """Dialogue with one sensor."""

    def __init__(self, address: str) -> None:
        self.line = SensorLine(address, 2 * max(protocol.SIZES.values()))

    def ask(self, command: int, kind: int, read: Callable[[bytes], Answer], payload: bytes = b"") -> Answer:
        """Send a request and decode the first reply of type `kind` by `read`."""
        self.request(command, payload)
        deadline_s = time.monotonic() + _REPLY_S
        while True:
            descriptor, data = self.reply(deadline_s)
            if descriptor.kind == kind:
                return read(data)

    def request(self, command: int, payload: bytes = b"") -> None:
        """Drop waiting replies and send a request."""
        self.line.split_by(protocol.ReplySplitter())
        self.line.send(protocol.request(command, payload))

    def reply(self, deadline_s: float | None = None) -> tuple[protocol.Descriptor, bytes]:
        """Return the next descriptor and its data; raises as `SensorLine.receive`."""
        reply: tuple[protocol.Descriptor, bytes]
        reply, _ = self.line.next(time.monotonic() + _REPLY_S if deadline_s is None else deadline_s)
        return reply


@dataclass(frozen=True, slots=True)
class StreamMode:
    """One scan mode."""

    number: int
    kind: int  # type of its packets
    point_ns: float  # time between two points


def typical_mode(dialogue: SlamtecDialogue) -> StreamMode:
    """Return the recommended mode; of firmware without modes, express or standard scans."""
    with suppress(DeviceTimeoutError):
        number = _configured(dialogue, protocol.CONF_TYPICAL, b"", "<H")
        of_mode = struct.pack("<H", number)
        kind = _configured(dialogue, protocol.CONF_ANSWER, of_mode, "<B")
        point_us = _configured(dialogue, protocol.CONF_SAMPLE_US, of_mode, "<I") / 256
        if kind in protocol.SIZES and point_us > 0:
            return StreamMode(number, kind, point_us * 1e3)
    standard_us, express_us = dialogue.ask(protocol.SAMPLE_TIMES, 0x15, protocol.sample_times)
    if express_us:
        return StreamMode(0, protocol.CAPSULES, express_us * 1e3)
    return StreamMode(0, protocol.NODES, max(standard_us, 1) * 1e3)


def _configured(dialogue: SlamtecDialogue, key: int, payload: bytes, layout: str) -> int:
    def value(data: bytes) -> int:
        if len(data) < 4 + struct.calcsize(layout) or int.from_bytes(data[:4], "little") != key:
            raise ProtocolError(f"RPLIDAR: {data.hex(' ')}: not the configuration {key:#x}")
        return int(struct.unpack_from(layout, data, 4)[0])

    return dialogue.ask(protocol.GET_CONF, 0x20, value, struct.pack("<I", key) + payload)

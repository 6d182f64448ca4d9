"""Capture of the raw bytes of devices, and replay of a capture as emulated devices.

A line of a capture is: time [ns, time.monotonic_ns], port, `<` (from the device) or `>` (to it), bytes in hex.
"""

from __future__ import annotations

import logging
import os
import select
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from scanwright.design.errors import RecordingError

_WAIT_S = 0.1  # longest delay of the end of a replay
_REMEDY = "`scanwright doctor --capture FILE` writes captures"
_log = logging.getLogger("scanwright.firmware_io.bytes")
_log.propagate = False  # only captures receive its records, at any level of the other loggers
_log.setLevel(logging.CRITICAL)


@contextmanager
def capturing(path: Path) -> Iterator[None]:
    """Write all bytes that devices exchange during the body to a new file; RecordingError if it cannot be created."""
    try:
        handler = logging.FileHandler(path, "x", encoding="ascii")
    except OSError as error:
        raise RecordingError(
            f"{path}: cannot write: {error.strerror}; name a new file in a folder that exists"
        ) from error
    _log.addHandler(handler)
    _log.setLevel(logging.DEBUG)
    try:
        yield
    finally:
        _log.removeHandler(handler)
        _log.setLevel(logging.CRITICAL)
        handler.close()


def captured(port: str, direction: str, data: bytes) -> bytes:
    """Return the bytes, and write them to a running capture."""
    if data and _log.isEnabledFor(logging.DEBUG):
        _log.debug("%d %s %s %s", time.monotonic_ns(), port, direction, data.hex())
    return data


@dataclass
class _Device:
    """A device that replays a capture: after each request, the bytes that followed it, at their times."""

    unrequested: list[tuple[int, bytes]] = field(default_factory=list)  # delay [ns] and bytes before the first request
    replies: dict[bytes, deque[list[tuple[int, bytes]]]] = field(default_factory=dict)  # the same, by request
    due: deque[tuple[int, bytes]] = field(default_factory=deque)  # time [ns] and bytes to send
    received: bytes = b""
    requested: bool = False

    def receive(self, data: bytes, now_ns: int) -> None:
        """Add received bytes; drops those that are not a request of the capture."""
        self.received += data
        while self.received:
            known = [request for request in self.replies if self.received.startswith(request)]
            if known:
                request = max(known, key=len)
                self.received, self.requested = self.received[len(request) :], True
                left = self.replies[request]
                reply = left.popleft() if len(left) > 1 else left[0]  # repeat the last one
                self.due = deque((now_ns + delay_ns, sent) for delay_ns, sent in reply)
            elif any(request.startswith(self.received) for request in self.replies):
                return
            else:
                self.received = self.received[1:]

    def send(self, now_ns: int) -> bytes:
        """Return the bytes that are due; a device that sends without a request restarts at the end."""
        if not (self.due or self.requested):
            self.due = deque((now_ns + delay_ns, sent) for delay_ns, sent in self.unrequested)
        ready = b""
        while self.due and self.due[0][0] <= now_ns:
            ready += self.due.popleft()[1]
        return ready


def _devices(path: Path) -> dict[str, _Device]:
    devices: dict[str, _Device] = {}
    replies: dict[str, tuple[int, list[tuple[int, bytes]]]] = {}  # of the last request: time, and bytes after it
    number = 0
    try:
        for line in path.read_text("ascii").splitlines():
            number += 1
            when, port, direction, text = line.split(" ")
            time_ns, data = int(when), bytes.fromhex(text)
            if port not in devices:
                devices[port] = _Device()
                replies[port] = time_ns, devices[port].unrequested
            if direction == ">":
                replies[port] = time_ns, []
                devices[port].replies.setdefault(data, deque()).append(replies[port][1])
            elif direction == "<":
                began_ns, reply = replies[port]
                reply.append((time_ns - began_ns, data))
            else:
                raise ValueError(direction)
    except OSError as error:
        raise RecordingError(f"{path}: cannot read: {error.strerror}; {_REMEDY}") from error
    except ValueError as error:  # also for bytes that are not ASCII
        raise RecordingError(f"{path}: {f'line {number}: ' * bool(number)}not a capture; {_REMEDY}") from error
    return devices


@contextmanager
def replaying(path: Path) -> Iterator[dict[str, str]]:
    """Emulate the devices of a capture during the body; yield port in the capture -> path of the pseudo-terminal.

    RecordingError if the file cannot be read or is not a capture.
    """
    import tty  # POSIX only, while captures are imported everywhere

    devices = _devices(path)
    terminals = [os.openpty() for _ in devices]
    masters = {master: device for (master, _), device in zip(terminals, devices.values(), strict=True)}
    for master, slave in terminals:  # the open slave keeps the port without clients
        tty.setraw(slave)
        os.set_blocking(master, False)
    ended = threading.Event()

    def serve() -> None:
        while not ended.is_set():
            times_ns = [device.due[0][0] for device in masters.values() if device.due]
            wait_s = min((min(times_ns, default=1 << 62) - time.monotonic_ns()) / 1e9, _WAIT_S)
            for master in select.select(list(masters), [], [], max(wait_s, 0.0))[0]:
                masters[master].receive(os.read(master, 4096), time.monotonic_ns())
            for master, device in masters.items():
                with suppress(BlockingIOError):  # the buffer is full: no program reads
                    os.write(master, device.send(time.monotonic_ns()))

    thread = threading.Thread(target=serve, name="replay")
    thread.start()
    try:
        yield {port: os.ttyname(slave) for port, (_, slave) in zip(devices, terminals, strict=True)}
    finally:
        ended.set()
        thread.join()
        for descriptor in (end for pair in terminals for end in pair):
            os.close(descriptor)

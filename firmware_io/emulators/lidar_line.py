"""Line of an emulated lidar: a pseudo-terminal, and TCP if the model has it, with the faults of real ones."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import tempfile
import threading
import time
import tty
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, Protocol, Self, TypeVar

import numpy as np

from scanwright.design.arrays import Floats, Times

Ranging = Callable[[Times, Floats], tuple[Floats, Floats]]
"""True times [ns, time.monotonic_ns] in order and bearings [rad] of beams, (n,) -> range [m] (inf or NaN: no return,
-inf: too near) and intensity, both (n,)."""

_AHEAD_NS = 8_000_000  # ray casting begins this long before the end of a turn, so that no scan is late
_LAG_NS = 500_000_000  # if ray casting is slower than the sensor, scans are dropped after this delay


class Machine(Protocol):
    """A sensor without its line, at given times."""

    @property
    def scanning(self) -> object:
        """A new value at each start and stop of scanning."""

    def receive(self, received: bytes, now_ns: int, /) -> tuple[bytes, bytes]:
        """Return the replies to complete requests, and the bytes of an incomplete one."""
        ...

    def next_ns(self) -> int:
        """Return the end of the next packets; far in the future if it does not scan."""
        ...

    def next_packets(self) -> list[tuple[int, bytes]]:
        """Measure the next packets; return the time of the last byte and the bytes of each."""
        ...

    def skip_to(self, before_ns: int) -> None:
        """Skip the packets before a time."""
        ...

    def power_cycle(self, now_ns: int) -> None:
        """Restart after a power cut."""
        ...


M_co = TypeVar("M_co", bound=Machine, covariant=True)


@dataclass(slots=True)
class _Channel:
    """Connection of one client."""

    fd: int
    close: Callable[[], None]
    received: bytes = b""  # of an incomplete request
    waiting: bytearray = field(default_factory=bytearray)  # to be sent


class LidarLine(Generic[M_co]):
    """A lidar on a pseudo-terminal (`port`, the same after a reconnection) and over TCP (`address`)."""

    def __init__(
        self,
        name: str,
        machine: M_co,
        *,
        jitter_s: float = 0.0,
        head: int = 0,
        backlog: int = 1 << 15,
        network: bool = True,
        seed: int = 0,
    ) -> None:
        """Prepare the emulator; it starts in `with`.

        Args:
            name: of the model.
            machine: the sensor.
            jitter_s: largest random delay of scans.
            head: bytes of a packet before its ranges, which `garble` does not change.
            backlog: bytes that wait for a slow reader before packets are dropped.
            network: whether it has TCP too.
            seed: of jitter and faults.
        """
        self.machine = machine
        self._name = name
        self._head = head
        self._backlog = backlog
        self._network = network
        self.address = ""  # "127.0.0.1:PORT"; empty if it has no network
        self._rng = np.random.default_rng(seed)
        self._jitter_ns = round(jitter_s * 1e9)
        self._lock = threading.RLock()
        self._faults: deque[Callable[[bytes], bytes]] = deque()
        self._sent: deque[tuple[int, bytes]] = deque()  # arrival and bytes of packets
        self._channels: dict[int, _Channel] = {}
        self._scans_to = -1
        self._tcp_port = 0
        self._server: socket.socket | None = None
        self._error: BaseException | None = None

    def __enter__(self) -> Self:
        self._folder = tempfile.TemporaryDirectory(prefix="lidar-emulator-")
        self.port = str(Path(self._folder.name, "lidar"))
        self._wake, self._woken = os.pipe()[::-1]
        self._running = True
        self.plug()
        self._thread = threading.Thread(target=self._run, name=f"{self._name} emulator")
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._running = False
        os.write(self._wake, b"x")
        self._thread.join()
        self.unplug()
        os.close(self._wake)
        os.close(self._woken)
        self._folder.cleanup()
        if self._error is not None:
            raise self._error

    def plug(self) -> None:
        """Connect the cable: create the port, and listen on the network."""
        with self._lock:
            master, slave = os.openpty()  # the open slave keeps the port without clients
            tty.setraw(slave)
            Path(self.port).unlink(missing_ok=True)
            Path(self.port).symlink_to(os.ttyname(slave))

            def close() -> None:
                os.close(master)
                os.close(slave)

            self._add(master, close)
            self._scans_to = master
            if self._network:
                self._server = socket.create_server(("127.0.0.1", self._tcp_port))
                self._server.setblocking(False)  # a client may be gone before it is accepted
                self._tcp_port = self._server.getsockname()[1]
                self.address = f"127.0.0.1:{self._tcp_port}"
        os.write(self._wake, b"x")

    def unplug(self) -> None:
        """Disconnect the cable: remove the port and break connections; the sensor keeps its power."""
        with self._lock:
            for fd in list(self._channels):
                self._channels.pop(fd).close()
            Path(self.port).unlink(missing_ok=True)
            if self._server is not None:
                self._server.close()
            self._sent.clear()

    def power_cycle(self) -> None:
        """Restart the sensor, its clock at 0 and its laser off; the cable stays connected."""
        with self._lock:
            self.machine.power_cycle(time.monotonic_ns())
            self._sent.clear()

    def garble(self, replies: int = 1) -> None:
        """Flip one bit of the ranges in each of the next scans."""

        def flip(scan: bytes) -> bytes:
            at, bit = int(self._rng.integers(self._head, len(scan) - 3)), 1 << int(self._rng.integers(6))
            return scan[:at] + bytes([scan[at] ^ bit]) + scan[at + 1 :]

        with self._lock:
            self._faults.extend([flip] * replies)

    def cut(self, replies: int = 1) -> None:
        """Lose a run of bytes with line ends in each of the next scans."""

        def lose(scan: bytes) -> bytes:
            at = int(self._rng.integers(len(scan) - 1))
            return scan[:at] + scan[at + int(self._rng.integers(1, 200)) :]

        with self._lock:
            self._faults.extend([lose] * replies)

    def _run(self) -> None:
        try:
            while self._running:
                self._serve()
        except Exception as error:  # raised again by __exit__
            self._error = error

    def _serve(self) -> None:
        with self._lock:
            due_ns = self.machine.next_ns() - _AHEAD_NS
            due_ns = min(due_ns, self._sent[0][0]) if self._sent else due_ns
            listening = -1 if self._server is None else self._server.fileno()
            readers = [self._woken, *self._channels, *([listening] if listening >= 0 else [])]
            writers = [fd for fd, channel in self._channels.items() if channel.waiting]
        wait_s = min(max(due_ns - time.monotonic_ns(), 0) / 1e9, 0.1)
        try:
            readable = select.select(readers, writers, [], wait_s)[0]
        except (OSError, ValueError):  # unplugged meanwhile
            return
        with self._lock:
            for ready in readable:
                if ready == listening and self._server is not None:
                    self._accept(self._server)
                elif ready == self._woken:
                    os.read(self._woken, 16)
                elif ready in self._channels:
                    self._receive(self._channels[ready])
            self._turn()
            for channel in list(self._channels.values()):
                self._flush(channel)

    def _accept(self, server: socket.socket) -> None:
        with contextlib.suppress(OSError):
            connection, _ = server.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._add(connection.fileno(), connection.close)

    def _add(self, fd: int, close: Callable[[], None]) -> None:
        os.set_blocking(fd, False)
        self._channels[fd] = _Channel(fd, close)

    def _drop(self, channel: _Channel) -> None:
        self._channels.pop(channel.fd).close()
        if self._scans_to == channel.fd:
            self._scans_to = -1

    def _receive(self, channel: _Channel) -> None:
        try:
            received = os.read(channel.fd, 4096)
        except BlockingIOError:
            return
        except OSError:
            received = b""
        if not received:
            self._drop(channel)
            return
        scanning = self.machine.scanning
        answers, channel.received = self.machine.receive(channel.received + received, time.monotonic_ns())
        channel.waiting += answers
        if self.machine.scanning is not scanning:  # began or ended
            self._scans_to = channel.fd
            self._sent.clear()

    def _turn(self) -> None:
        """Measure the turn that is about to end, and send the packets that are due."""
        self.machine.skip_to(time.monotonic_ns() - _LAG_NS)
        if self.machine.next_ns() - _AHEAD_NS <= time.monotonic_ns():
            late_ns = round(self._rng.uniform(0, self._jitter_ns)) if self._jitter_ns else 0
            for sent_ns, packet_bytes in self.machine.next_packets():
                packet = self._faults.popleft()(packet_bytes) if self._faults else packet_bytes
                self._sent.append((max(sent_ns + late_ns, self._sent[-1][0] if self._sent else 0), packet))
        while self._sent and self._sent[0][0] <= time.monotonic_ns():
            packet = self._sent.popleft()[1]
            channel = self._channels.get(self._scans_to)
            if channel is not None and len(channel.waiting) < self._backlog:
                channel.waiting += packet

    def _flush(self, channel: _Channel) -> None:
        try:
            while channel.waiting:
                del channel.waiting[: os.write(channel.fd, channel.waiting)]
        except BlockingIOError:
            return
        except OSError:
            self._drop(channel)

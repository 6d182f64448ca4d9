"""Emulator of a servo on a pseudo-terminal, with baud rate and return delay of a real one; methods cause faults."""

from __future__ import annotations

import fcntl
import os
import random
import select
import struct
import sys
import tempfile
import termios
import threading
import time
import tty
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from pkgutil import resolve_name
from queue import SimpleQueue
from typing import Self

from scanwright.design.errors import DeviceError, removal
from scanwright.firmware_io.emulators.servo.machine import ServoMachine, answers
from scanwright.firmware_io.emulators.servo_plant import Load
from scanwright.firmware_io.servo.families import all_families, all_tables
from scanwright.firmware_io.servo.fitness import set_up_counts

_TICK_S = 0.02  # between two checks of its protection


class ServoEmulator:
    """One servo with power on its bus; a context manager.

    Attributes:
        port: path of the serial port; the same after a reconnection.
        axis: true motion of the horn, by `time.monotonic_ns()`.
        memory: control table with factory values, to be changed before a program opens the port.

    Args:
        model: catalogue name.
        protocol: None for the factory setting.
        load: of the horn.
        angle_rad: of the horn at power-up.
        others: model and id of other servos on the bus.
        echo: whether the adapter has an echo.
        seed: of the bit errors.
    """

    def __init__(
        self,
        model: str = "MX-64R",
        protocol: str | None = None,
        *,
        load: Load | None = None,
        angle_rad: float = 0.0,
        others: Sequence[tuple[str, int]] = (),
        echo: bool = False,
        seed: int = 0,
    ) -> None:
        now_ns = time.monotonic_ns()
        self._servo = machine_of(model, protocol, Load() if load is None else load, now_ns, angle_rad)
        self._servos = [self._servo]
        for other_model, other_id in others:
            other = machine_of(other_model, self._servo.table.protocol, Load(), now_ns, 0.0)
            other.memory[other.table.id.address] = other_id
            self._servos.append(other)
        self.axis, self.memory = self._servo.axis, self._servo.memory
        self._echo = echo
        self._random = random.Random(seed)
        self._bit_error_rate = 0.0
        self._cut = False
        self._folder = tempfile.TemporaryDirectory(prefix="servo-emulator-")
        self.port = str(Path(self._folder.name) / "ttyServo")
        self._master = self._slave = -1
        self._plug()
        self._jobs: SimpleQueue[tuple[Callable[[], None], threading.Event] | None] = SimpleQueue()
        self._wake_read, self._wake_write = os.pipe()
        self._thread = threading.Thread(target=self._run, name=f"emulator of {model}", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove the emulator from its port; can be called again."""
        if self._thread.is_alive():
            self._jobs.put(None)
            os.write(self._wake_write, b".")
            self._thread.join()
            self._pull()
            os.close(self._wake_read)
            os.close(self._wake_write)
            self._folder.cleanup()

    def set_up(self, *, spins: bool | None) -> None:
        """Configure the servo for a scan; `spins` None leaves the mode unchanged."""
        for register, count in set_up_counts(self._servo.table, round(self._servo.baud), spins=spins).items():
            self.memory[register.address] = count

    def bit_errors(self, rate: float) -> None:
        """Flip one bit of each byte of a reply with this probability."""
        self._bit_error_rate = rate

    def stall(self) -> None:
        """Block the horn."""
        self._do(lambda: self.axis.change(time.monotonic_ns(), blocked=True))

    def release(self) -> None:
        """Unblock the horn."""
        self._do(lambda: self.axis.change(time.monotonic_ns(), blocked=False))

    def overload(self) -> None:
        """Trip the overload protection."""
        self._do(lambda: self._servo.overload(time.monotonic_ns()))

    def overheat(self) -> None:
        """Heat the motor to 5 degrees above its limit."""
        self._do(self._servo.overheat)

    def set_voltage(self, volts: float) -> None:
        """Set the supply voltage."""
        self._do(lambda: self._servo.set_voltage(volts, time.monotonic_ns()))

    def brown_out(self) -> None:
        """Interrupt the supply: the servo restarts, without replies meanwhile."""
        self._do(lambda: self._servo.restart(time.monotonic_ns()))

    def cut(self) -> None:
        """Cut the bus but not the power, so in protocol 1.0 a spin continues."""
        self._cut = True

    def reconnect_bus(self) -> None:
        """Repair the bus."""
        self._cut = False

    def unplug(self) -> None:
        """Unplug the USB adapter: the port is gone, the servo keeps its power."""
        self._do(self._pull)

    def replug(self) -> None:
        """Plug in the adapter, with the same name."""
        self._do(self._plug)

    def _do(self, job: Callable[[], None]) -> None:
        """Run a job in the emulator's thread, which alone uses servo and port, and wait for its end."""
        done = threading.Event()
        self._jobs.put((job, done))
        os.write(self._wake_write, b".")
        while not done.wait(1.0):
            if not self._thread.is_alive():
                raise RuntimeError("the emulator is closed, or its thread has ended with an error")

    def _plug(self) -> None:
        self._pull()
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        Path(self.port).symlink_to(os.ttyname(self._slave))

    def _pull(self) -> None:
        if self._master >= 0:
            Path(self.port).unlink()
            os.close(self._master)
            os.close(self._slave)  # open until now, as a port stays when a program closes it
        self._master = self._slave = -1

    def _run(self) -> None:
        buffer, received_ns = bytearray(), 0
        while True:
            ports = [] if self._master < 0 else [self._master]
            ready = select.select([self._wake_read, *ports], [], [], _TICK_S)[0]
            now_ns = time.monotonic_ns()
            for servo in self._servos:
                servo.protect(now_ns)
            if self._wake_read in ready:
                os.read(self._wake_read, 1)
                task = self._jobs.get()
                if task is None:
                    return
                task[0]()
                task[1].set()
            elif ready:
                data = os.read(self._master, 4096)
                if self._echo:
                    self._send(data)
                if now_ns - received_ns > self._servo.forgets_ns:
                    buffer.clear()
                received_ns = now_ns
                baud = _client_baud(self._master)
                receivers = [
                    servo for servo in self._servos if servo.listens(now_ns) and abs(baud / servo.baud - 1) < 0.03
                ]
                if receivers and not self._cut:
                    buffer += data
                    self._serve(receivers, buffer, now_ns)

    def _serve(self, receivers: Sequence[ServoMachine], buffer: bytearray, begin_ns: int) -> None:
        """Reply to the requests in the buffer, whose first byte arrived at `begin_ns`."""
        byte_ns = 10e9 / receivers[0].baud
        while request := receivers[0].take(buffer):
            arrived_ns = begin_ns + round(len(request.wire) * byte_ns)
            delay_ns, begin_ns = receivers[0].return_delay_ns, arrived_ns
            for answer in answers(receivers, request, arrived_ns):
                begin_ns += delay_ns + round(len(answer) * byte_ns)
                time.sleep(max(0.0, (begin_ns - time.monotonic_ns()) / 1e9))
                self._send(self._damaged(answer))

    def _send(self, data: bytes) -> None:
        with suppress(BlockingIOError):  # without a reader, bytes are lost as at a real port
            os.write(self._master, data)

    def _damaged(self, answer: bytes) -> bytes:
        if not self._bit_error_rate:
            return answer
        flips = (1 << self._random.randrange(8) if self._random.random() < self._bit_error_rate else 0 for _ in answer)
        return bytes(byte ^ flip for byte, flip in zip(answer, flips, strict=True))


def _client_baud(master: int) -> float:
    """Return the baud rate that the client has set."""
    if sys.platform == "linux":  # TCGETS2: the only request with non-standard rates
        return float(struct.unpack("=36x2I", fcntl.ioctl(master, 0x802C542A, bytes(44)))[1])
    return float(termios.tcgetattr(master)[5])


def machine_of(model: str, protocol: str | None, load: Load, time_ns: int, angle_rad: float) -> ServoMachine:
    """Return an emulated servo with power, or raise DeviceError; `protocol` None: the factory setting."""
    for family in all_families().values():
        for table in family.tables:
            if table.model == model and protocol in (None, table.protocol):
                made: ServoMachine = resolve_name(family.emulator)(table, load, time_ns, angle_rad)
                return made
    there = ", ".join(f"{table.model} with {table.protocol}" for table in all_tables())
    name = model if protocol is None else f"{model} with {protocol}"
    raise DeviceError(f"there is no emulator of a servo {name}; {removal(model) or f'there are: {there}'}")

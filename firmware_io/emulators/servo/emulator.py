"""Emulator of a servo on a pseudo-terminal, with the timing of a real one.

Bytes take their time at the baud rate, the return delay is kept, another baud rate is not understood. The
`ServoMachine` of its family answers and turns. Methods cause faults.
"""

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
from queue import SimpleQueue
from types import TracebackType
from typing import Self

from scanwright.firmware_io.emulators.servo.machine import ServoMachine, answers
from scanwright.firmware_io.emulators.servo.models import machine_of
from scanwright.firmware_io.emulators.servo_plant import Load
from scanwright.firmware_io.servo.fitness import set_up_counts

_TICK_S = 0.02  # between two looks of the servo at itself


class ServoEmulator:
    """One servo, powered and on its bus; `port` is what a program opens. A context manager.

    Attributes:
        port: path of the serial port; the same after a re-plug.
        axis: the true motion of the horn, by `time.monotonic_ns()`.
        memory: the control table; factory values, to be changed before a program opens the port.

    Args:
        model: name, as in the catalogue.
        protocol: as the maker calls it, or None for the one that the model has from the factory.
        load: what hangs on the horn.
        angle_rad: of the horn when it is switched on.
        others: other servos on the bus: model and number.
        echo: whether the adapter returns what it sends.
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

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Take the emulator off its port. May be called again."""
        if self._thread.is_alive():
            self._jobs.put(None)
            os.write(self._wake_write, b".")
            self._thread.join()
            self._pull()
            os.close(self._wake_read)
            os.close(self._wake_write)
            self._folder.cleanup()

    def set_up(self, *, spins: bool | None) -> None:
        """Give the servo the settings of one that is ready for a scan; `spins` None leaves the mode as it is."""
        for register, count in set_up_counts(self._servo.table, round(self._servo.baud), spins=spins).items():
            self.memory[register.address] = count

    def bit_errors(self, rate: float) -> None:
        """From now on, each byte of an answer has one bit flipped with this probability."""
        self._bit_error_rate = rate

    def stall(self) -> None:
        """Something holds the horn."""
        self._do(lambda: self.axis.change(time.monotonic_ns(), blocked=True))

    def release(self) -> None:
        """Nothing holds the horn any more."""
        self._do(lambda: self.axis.change(time.monotonic_ns(), blocked=False))

    def overload(self) -> None:
        """The overload protection trips."""
        self._do(lambda: self._servo.overload(time.monotonic_ns()))

    def overheat(self) -> None:
        """The motor is 5 degrees above its limit."""
        self._do(self._servo.overheat)

    def set_voltage(self, volts: float) -> None:
        """The supply gives another voltage; one that breaks down is a `brown_out`."""
        self._do(lambda: self._servo.set_voltage(volts, time.monotonic_ns()))

    def brown_out(self) -> None:
        """The supply breaks down for a moment: the servo restarts, mute until it has."""
        self._do(lambda: self._servo.restart(time.monotonic_ns()))

    def cut(self) -> None:
        """The bus is cut: no byte passes; power stays, so in protocol 1.0 the wheel turns on."""
        self._cut = True

    def reconnect_bus(self) -> None:
        """The bus is whole again."""
        self._cut = False

    def unplug(self) -> None:
        """The USB adapter is pulled: the port is gone, the servo keeps its power."""
        self._do(self._pull)

    def replug(self) -> None:
        """The adapter is back, under the same name."""
        self._do(self._plug)

    def _do(self, job: Callable[[], None]) -> None:
        """Let the emulator's own thread do it, which alone touches servo and port; wait until it is done."""
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
            os.close(self._slave)  # held open so far, as a port does not vanish when a program closes it
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
                if self._echo:  # the adapter does that, whatever the servo makes of it
                    self._send(data)
                if now_ns - received_ns > self._servo.forgets_ns:
                    buffer.clear()
                received_ns = now_ns
                if not self._cut and (hearing := self._hearing(now_ns)):
                    buffer += data
                    self._serve(hearing, buffer, now_ns)

    def _hearing(self, now_ns: int) -> list[ServoMachine]:
        """The servos that are up, and whose baud rate is the client's within 3 %."""
        baud = _client_baud(self._master)
        return [servo for servo in self._servos if servo.listens(now_ns) and abs(baud / servo.baud - 1) < 0.03]

    def _serve(self, hearing: Sequence[ServoMachine], buffer: bytearray, begin_ns: int) -> None:
        """Let them answer the requests in the buffer, the first byte of which came at `begin_ns`."""
        byte_ns = 10e9 / hearing[0].baud
        while request := hearing[0].take(buffer):
            arrived_ns = begin_ns + round(len(request.wire) * byte_ns)
            delay_ns, begin_ns = hearing[0].return_delay_ns, arrived_ns
            for answer in answers(hearing, request, arrived_ns):
                begin_ns += delay_ns + round(len(answer) * byte_ns)
                time.sleep(max(0.0, (begin_ns - time.monotonic_ns()) / 1e9))
                self._send(self._damaged(answer))

    def _send(self, data: bytes) -> None:
        with suppress(BlockingIOError):  # nobody reads: what does not fit is lost, as with a real port
            os.write(self._master, data)

    def _damaged(self, answer: bytes) -> bytes:
        if not self._bit_error_rate:
            return answer
        flips = (1 << self._random.randrange(8) if self._random.random() < self._bit_error_rate else 0 for _ in answer)
        return bytes(byte ^ flip for byte, flip in zip(answer, flips, strict=True))


def _client_baud(master: int) -> float:
    """Baud rate that the client has set on its end."""
    if sys.platform == "linux":  # TCGETS2: the only way to see rates beyond the standard ones
        return float(struct.unpack("=36x2I", fcntl.ioctl(master, 0x802C542A, bytes(44)))[1])
    return float(termios.tcgetattr(master)[5])

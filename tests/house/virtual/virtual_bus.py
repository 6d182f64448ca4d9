"""Servos on a bus whose clock goes forward only where somebody waits."""

import random
from collections import deque

from virtual_time import OnClock

from scanwright.firmware_io.emulators.servo.emulator import machine_of
from scanwright.firmware_io.emulators.servo.machine import answers
from scanwright.firmware_io.emulators.servo_plant import Load
from scanwright.firmware_io.servo import guard, servo
from scanwright.firmware_io.servo.bus import serial_line
from scanwright.firmware_io.servo.fitness import set_up_counts


class VirtualBus(OnClock):
    """The machines of `ServoEmulator` behind a port of pyserial's shape, the clock of both, and all that was sent."""

    port = "virtual"
    is_open = True

    def __init__(self, model, protocol=None, others=(), clock=None, seed=0, angle_rad=0.0):
        super().__init__(clock)
        self.baudrate, self.timeout = 57_600, 0.0
        self.servo = machine_of(model, protocol, Load(), self.now_ns, angle_rad)
        self.servos = [self.servo]
        for other_model, number in others:
            other = machine_of(other_model, self.servo.table.protocol, Load(), self.now_ns, 0.0)
            other.memory[other.table.id.address] = number
            self.servos.append(other)
        self.memory = self.servo.memory
        self.plugged, self.cut = True, False  # the adapter; the cable to the servo
        self.bit_error_rate, self.shorted, self.echo = 0.0, False, False
        self.heard, self.writes = bytearray(), []
        self._random = random.Random(seed)
        self._coming = deque()  # when, and which byte

    def set_up(self, *, spins):
        """Give the servo the settings of one that is ready for a scan."""
        for register, count in set_up_counts(self.servo.table, round(self.servo.baud), spins=spins).items():
            self.memory[register.address] = count

    def open(self, port, baud, timeout):
        self._here()
        self.port, self.baudrate, self.timeout, self.is_open = port, baud, timeout, True
        return self

    def fileno(self):
        return -1

    def unplug(self):
        self.plugged = False
        self._coming.clear()

    def brown_out(self):
        self.servo.restart(self.now_ns)
        self.sleep(10.0)

    def write(self, data):
        self._here()
        self.heard += data
        self.writes.append(bytes(data))
        byte_ns = round(10e9 / self.baudrate)
        self.now_ns += len(data) * byte_ns
        at_ns = self.now_ns
        if self.echo:
            self._coming.extend((at_ns, byte) for byte in data)
        if self.shorted:
            self._coming.extend((at_ns + (k + 1) * byte_ns, 0) for k in range(len(data)))
        for delay_ns, answer in self.serve(data, self.now_ns):
            at_ns += delay_ns
            for byte in answer:
                at_ns += byte_ns
                flip = 1 << self._random.randrange(8) if self._random.random() < self.bit_error_rate else 0
                self._coming.append((at_ns, byte ^ flip))

    def hears(self):
        """Whether anything that is sent reaches the servo."""
        return self.plugged and not (self.cut or self.shorted) and self.servo.listens(self.now_ns)

    def serve(self, data, now_ns):
        """What the servos answer to bytes that were whole at a time, and how long each waits with it."""
        for one in self.servos:
            one.protect(now_ns)
        hearing = [s for s in self.servos if s.listens(now_ns) and abs(self.baudrate / s.baud - 1) < 0.03]
        buffer, given = bytearray(data), []
        while hearing and not (self.cut or self.shorted) and (request := hearing[0].take(buffer)):
            given += [(hearing[0].return_delay_ns, answer) for answer in answers(hearing, request, now_ns)]
        return given

    def read(self, length):
        self._here()
        end_ns = self.now_ns + round(self.timeout * 1e9)
        data = bytearray()
        while len(data) < length and self._coming and self._coming[0][0] <= end_ns:
            at_ns, byte = self._coming.popleft()
            self.now_ns = max(self.now_ns, at_ns)
            data.append(byte)
        if len(data) < length:
            self.now_ns = end_ns
        return bytes(data)

    def reset_input_buffer(self):
        while self._coming and self._coming[0][0] <= self.now_ns:
            self._coming.popleft()

    def close(self):
        self._coming.clear()
        self.is_open = False

    def _here(self):
        if not self.plugged:
            raise OSError("unplugged")


class VirtualServo(VirtualBus):
    """A `VirtualBus` with the methods of `ServoEmulator`."""

    @property
    def axis(self):
        return self.servo.axis

    @property
    def _servo(self):
        return self.servo

    def install(self, monkeypatch):
        """Put bus, clock and guard in the place of the real ones."""
        self.clock.put_in_place_of_time(monkeypatch, "scanwright.firmware_io.servo")
        monkeypatch.setattr(serial_line, "open_serial_port", self.open)
        monkeypatch.setattr(servo, "Guard", lambda _, *packet_and_answer: VirtualGuard(self, *packet_and_answer))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def bit_errors(self, rate):
        self.bit_error_rate = rate

    def stall(self):
        self.axis.change(self.now_ns, blocked=True)

    def overload(self):
        self.servo.overload(self.now_ns)

    def overheat(self):
        self.servo.overheat()

    def set_voltage(self, volts):
        self.servo.set_voltage(volts, self.now_ns)

    def brown_out(self):
        self.servo.restart(self.now_ns)


class VirtualGuard:
    """`guard.Guard`, which acts when somebody looks: at the time at which the process would have."""

    def __init__(self, bus, packet, _answer):
        self._bus, self._packet, self._turns, self._heard_ns, self._acted = bus, packet, False, 0, False

    def turning(self):
        return self._heard(turns=True)

    beat = turning

    def resting(self):
        return self._heard(turns=False)

    def dismiss(self, at_rest):
        if not at_rest and not self._acted:
            self._act(self._bus.now_ns)
        return at_rest or self._stopped

    def _heard(self, turns):
        silent_until_ns = self._heard_ns + round(guard.SILENCE_S * 1e9)
        if self._turns and not self._acted and self._bus.now_ns > silent_until_ns:
            self._act(silent_until_ns)
        self._turns, self._heard_ns = turns, self._bus.now_ns
        return not self._acted

    def _act(self, time_ns):
        self._acted, self._stopped = True, self._bus.hears()
        if self._stopped:
            self._bus.serve(self._packet, time_ns)

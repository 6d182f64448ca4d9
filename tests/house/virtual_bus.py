"""Servos on a bus whose clock goes forward only where somebody waits."""

from collections import deque

from scanwright.firmware_io.emulators.servo.machine import answers
from scanwright.firmware_io.emulators.servo.models import machine_of
from scanwright.firmware_io.emulators.servo_plant import Load


class VirtualBus:
    """The machines of `ServoEmulator` behind a port of pyserial's shape, the clock of both, and all that was sent."""

    port = "virtual"
    is_open = True

    def __init__(self, model, protocol=None, others=()):
        self.now_ns = 1_000_000_000
        self.baudrate, self.timeout = 57_600, 0.0
        self.servo = machine_of(model, protocol, Load(), self.now_ns, 0.0)
        self.servos = [self.servo]
        for other_model, number in others:
            other = machine_of(other_model, self.servo.table.protocol, Load(), self.now_ns, 0.0)
            other.memory[other.table.id.address] = number
            self.servos.append(other)
        self.memory = self.servo.memory
        self.heard, self.writes = bytearray(), []
        self._coming = deque()  # when, and which byte

    def monotonic(self):
        return self.now_ns / 1e9

    def monotonic_ns(self):
        return self.now_ns

    def sleep(self, seconds):
        self.now_ns += round(seconds * 1e9)

    def brown_out(self):
        self.servo.restart(self.now_ns)
        self.sleep(10.0)

    def write(self, data):
        self.heard += data
        self.writes.append(bytes(data))
        hearing = [s for s in self.servos if s.listens(self.now_ns) and abs(self.baudrate / s.baud - 1) < 0.03]
        buffer, byte_ns = bytearray(data), round(10e9 / self.baudrate)
        self.now_ns += len(data) * byte_ns
        at_ns = self.now_ns
        while hearing and (request := hearing[0].take(buffer)):
            delay_ns = hearing[0].return_delay_ns
            for answer in answers(hearing, request, self.now_ns):
                at_ns += delay_ns
                for byte in answer:
                    at_ns += byte_ns
                    self._coming.append((at_ns, byte))

    def read(self, length):
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

"""One servo on a bus, by its registers; failures raise DeviceError."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass

from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.servo.bus.bus import ServoAnswer, ServoBus
from scanwright.firmware_io.servo.bus.registers import ControlTable, Register

PING_S = 0.05  # a servo answers within a millisecond; USB adapters gather bytes for up to 16 ms, both ways


@dataclass(frozen=True, slots=True)
class ServoUnit:
    """One servo that answers."""

    bus: ServoBus  # that it is on
    table: ControlTable  # of its model
    id: int  # its number on the bus
    was_mute: bool = False  # it answered nothing but pings before

    def __str__(self) -> str:
        return f"{self.bus.port}: servo {self.id}"

    def read(self, register: Register) -> ServoAnswer:
        """The bytes of a register or a block; raises as `ServoBus.read`."""
        return self.bus.read(self.id, register)

    def present(self) -> ServoAnswer:
        """The present values, for `ControlTable.pick`, and the time of the position; raises as `ServoBus.read`."""
        return self.read(self.table.present)

    def has_torque(self) -> bool:
        """Whether its torque is on: it holds or turns."""
        return bool(self.count(self.table.torque))

    def value(self, register: Register) -> float:
        """What a register holds, in SI units."""
        return register.decode(self.read(register).data)

    def count(self, register: Register) -> int:
        """What a register holds, in counts."""
        return round(self.value(register) / register.unit)

    def write(self, register: Register, value: float) -> ServoAnswer:
        """Write a value in SI units; raises as `ServoBus.write`."""
        return self.bus.write(self.id, register, register.encode(value))

    def torque_off(self) -> tuple[bytes, bytes]:
        """The packet that takes the torque, and what the answer to it begins with."""
        torque = self.table.torque
        return self.bus.write_packet(self.id, torque, torque.encode(0)), self.bus.packets.acknowledged(self.id)

    def reported_fault(self, answer: ServoAnswer) -> str | None:
        """What the servo reports of itself with an answer, in words; None if it is well."""
        if not answer.conditions:
            return None
        fault = self.table.hardware_error
        return self.table.names(answer.conditions if fault is None else self.count(fault))

    def set_permanent(self, register: Register, count: int) -> int:
        """Set an entry that is permanent, torque being off; its count before. Written if it differs: it wears."""
        was = self.count(register)
        if was != count:
            self._unlock(True)
            try:
                self.write(register, count * register.unit)
            finally:
                self._unlock(False)
            if self.count(register) != count:
                raise DeviceError(f"{self}: {register} stays {was}: its memory is locked; switch its power off and on")
        return was

    def _unlock(self, open_it: bool) -> None:
        lock, wanted = self.table.lock, 0 if open_it else 1
        if lock is None:
            return
        try:
            self.write(lock, wanted)
        except DeviceTimeoutError:  # it may be set not to answer what it is told
            if self.count(lock) != wanted:
                raise

    def set_baud(self, baud: int) -> None:
        """Set its speed, torque being off, and find it at its new one."""
        register, count, before = self.table.baud, self.table.baud_count(baud), self.bus.baud
        if not self.bus.set_baud(baud):
            raise DeviceError(f"{self.bus.port}: this adapter cannot do {baud} baud; nothing was changed")
        self.bus.set_baud(before)
        self._unlock(True)
        self.bus.write_unanswered(self.id, register, register.encode(count))
        time.sleep(PING_S)  # until the request is out at the old speed, and its answer, if any, is over
        for speed in (baud, before):
            self.bus.set_baud(speed)
            with suppress(DeviceTimeoutError, ProtocolError):
                if self.id in self.bus.ping(self.id, PING_S) and self.count(register) == count:
                    self._unlock(False)
                    return
        raise DeviceTimeoutError(
            f"{self}: {register}: no answer after {count} was written: switch it off and on, then try again"
        )

    def set_id(self, new_id: int) -> ServoUnit:
        """Give it another number, torque being off; the servo with it, read back."""
        register = self.table.id
        self._unlock(True)
        self.bus.write_unanswered(self.id, register, register.encode(new_id))
        time.sleep(PING_S)  # whether it answers with the old number or the new is its own affair
        renamed = ServoUnit(self.bus, self.table, new_id)
        if renamed.count(register) != new_id:
            raise DeviceError(f"{self}: no answer as {new_id}: switch it off and on, then try again")
        renamed._unlock(False)
        return renamed

    def answer_everything(self) -> None:
        """Set it to answer everything; this is permanent if `ControlTable.is_permanent` says so."""
        level = self.table.status_return
        with_answer = level.encode(self.table.answers_all)
        try:
            answers = self.read(level).data == with_answer
        except DeviceTimeoutError:
            answers = False
        if not answers:
            self.set_answers(level, self.table.answers_all)

    def set_answers(self, level: Register, count: int) -> None:
        """Set what it answers, torque being off; not read back, as it may not answer that."""
        self._unlock(True)
        self.bus.write_unanswered(self.id, level, level.encode(count))
        time.sleep(PING_S)  # whether it answers this very write is unknown: let an answer come and be dropped
        self._unlock(False)

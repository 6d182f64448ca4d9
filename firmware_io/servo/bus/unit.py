"""Access to the registers of one servo; failures raise DeviceError."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass

from scanwright.design.errors import DeviceError, DeviceTimeoutError, ProtocolError
from scanwright.firmware_io.servo.bus.bus import ServoAnswer, ServoBus
from scanwright.firmware_io.servo.bus.registers import ControlTable, Register

PING_S = 0.05  # a servo replies within a millisecond; USB adapters delay bytes up to 16 ms, in both directions


@dataclass(frozen=True, slots=True)
class ServoUnit:
    """One servo that replies."""

    bus: ServoBus
    table: ControlTable
    id: int
    was_mute: bool = False  # it replied only to pings before

    def __str__(self) -> str:
        return f"{self.bus.port}: servo {self.id}"

    def read(self, register: Register) -> ServoAnswer:
        """Read a register or a block; raises as `ServoBus.read`."""
        return self.bus.read(self.id, register)

    def present(self) -> ServoAnswer:
        """Read the present values, for `ControlTable.pick`; raises as `ServoBus.read`."""
        return self.read(self.table.present)

    def has_torque(self) -> bool:
        """Whether its torque is on."""
        return bool(self.count(self.table.torque))

    def value(self, register: Register) -> float:
        """Read a register in SI units."""
        return register.decode(self.read(register).data)

    def count(self, register: Register) -> int:
        """Read a register in counts."""
        return round(self.value(register) / register.unit)

    def write(self, register: Register, value: float) -> ServoAnswer:
        """Write a value in SI units; raises as `ServoBus.write`."""
        return self.bus.write(self.id, register, register.encode(value))

    def torque_off(self) -> tuple[bytes, bytes]:
        """Return the packet that turns the torque off, and the first bytes of its reply."""
        torque = self.table.torque
        return self.bus.write_packet(self.id, torque, torque.encode(0)), self.bus.packets.acknowledged(self.id)

    def reported_fault(self, answer: ServoAnswer) -> str | None:
        """Return the names of the faults reported in a reply; None without a fault."""
        if not answer.conditions:
            return None
        fault = self.table.hardware_error
        return self.table.names(answer.conditions if fault is None else self.count(fault))

    def set_permanent(self, register: Register, count: int) -> int:
        """Set a permanent register if it differs, with torque off; return its count before."""
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

    def _unlock(self, unlocked: bool) -> None:
        lock, count = self.table.lock, 0 if unlocked else 1
        if lock is None:
            return
        try:
            self.write(lock, count)
        except DeviceTimeoutError:  # possibly set not to reply to writes
            if self.count(lock) != count:
                raise

    def set_baud(self, baud: int) -> None:
        """Set its baud rate, with torque off, and find it at the new one."""
        register, count, before = self.table.baud, self.table.baud_count(baud), self.bus.baud
        if not self.bus.set_baud(baud):
            raise DeviceError(f"{self.bus.port}: this adapter does not support {baud} baud; nothing was changed")
        self.bus.set_baud(before)
        self._unlock(True)
        self.bus.write_unanswered(self.id, register, register.encode(count))
        time.sleep(PING_S)  # until request and possible reply at the old rate are complete
        for rate in (baud, before):
            self.bus.set_baud(rate)
            with suppress(DeviceTimeoutError, ProtocolError):
                if self.id in self.bus.ping(self.id, PING_S) and self.count(register) == count:
                    self._unlock(False)
                    return
        raise DeviceTimeoutError(
            f"{self}: {register}: no answer after {count} was written: switch it off and on, then try again"
        )

    def set_id(self, new_id: int) -> ServoUnit:
        """Set its id, with torque off; return the servo with the new id, read back."""
        register = self.table.id
        self._unlock(True)
        self.bus.write_unanswered(self.id, register, register.encode(new_id))
        time.sleep(PING_S)  # it can reply with the old or the new id
        renamed = ServoUnit(self.bus, self.table, new_id)
        if renamed.count(register) != new_id:
            raise DeviceError(f"{self}: no answer as {new_id}: switch it off and on, then try again")
        renamed._unlock(False)
        return renamed

    def answer_everything(self) -> None:
        """Set it to reply to all requests; permanent if `ControlTable.is_permanent`."""
        level = self.table.status_return
        try:
            if self.read(level).data == level.encode(self.table.answers_all):
                return
        except DeviceTimeoutError:
            pass
        self.set_answers(self.table.answers_all)

    def set_answers(self, count: int) -> None:
        """Set to which requests it replies, with torque off; not read back, as it may not reply to that."""
        level = self.table.status_return
        self._unlock(True)
        self.bus.write_unanswered(self.id, level, level.encode(count))
        time.sleep(PING_S)  # it may or may not reply to this write
        self._unlock(False)

"""Driver of one servo: spin, sweep, hold, read. On every exit the servo is stopped and its port closed.

An error that leaves `with` has a note: the servo confirmed that its torque is off, or could not be stopped.
`open_servo` detects baud rate, protocol and model, and turns the torque off. Permanent settings are written only with
a folder for the undo file. While the servo turns, call `read` at least every two seconds: it counts turns, and
otherwise the watchdog process stops the servo, as does its bus watchdog if it has one.

A servo without a bus watchdog (protocol 1.0, STS) that spins continues if its bus is cut.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NoReturn, Self

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import DeviceError, DeviceFaultError, UnsafeError, UnsafeNote
from scanwright.firmware_io.servo.bus.bus import ServoAnswer
from scanwright.firmware_io.servo.bus.registers import RPM
from scanwright.firmware_io.servo.bus.unit import ServoUnit
from scanwright.firmware_io.servo.find import find_servo, open_bus
from scanwright.firmware_io.servo.fitness import mode_changes
from scanwright.firmware_io.servo.guard import SILENCE_S, Guard
from scanwright.firmware_io.servo.prepare import prepare, set_agreed
from scanwright.firmware_io.servo.progress import ServoState, Stall, TurnOrder, follow, state_of

_GENTLE_RAD_S = 0.5  # to the end of the range of an AX-12A, if it begins to hold in its dead sector

_IS_OFF = "has answered that its torque is off"
_ADVICE = {
    "overload": "free the axis, balance or lighten the head, then open the servo again",
    "overheating": "let it cool down; then use a lower rate or a lighter head",
    "voltage": "check its supply and the cable to it",
}


class ServoDriver:
    """One servo; made by `open_servo`, used as a context manager.

    Attributes:
        model: catalogue name.
        protocol: name given by the maker, such as "2.0".
        baud: baud rate.
        id: on the bus.
        port: name of the port.
        step_rad: resolution of the encoder.
    """

    def __init__(self, unit: ServoUnit, warnings: tuple[str, ...], undo_folder: Path | None = None) -> None:
        table, bus = unit.table, unit.bus
        self.model, self.protocol, self.id = table.model, table.protocol, unit.id
        self.baud, self.port = bus.baud, bus.port
        self.step_rad = abs(table.position.unit)
        self._unit, self._bus, self._table, self._warnings = unit, bus, table, warnings
        self._product = load_catalogue().get(table.model, Servo)
        self._undo_folder = undo_folder
        self._spins: bool | None = None  # in wheel mode; None without torque
        self._order: TurnOrder | None = None
        self._known: ServoState | None = None  # last state with a position, from which turns are counted
        self._guard = Guard(bus.fileno(), *unit.torque_off())

    def __str__(self) -> str:
        return f"{self.port}: servo {self.id} ({self.model})"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            self.close()
        except DeviceError as unsafe:
            if error is None:
                raise
            error.add_note(UnsafeNote(unsafe))  # the first error is more important
        else:
            if error is not None:
                error.add_note(f"{self} {_IS_OFF}")

    def close(self) -> None:
        """Turn the torque off, close the port; UnsafeError if the servo does not reply. Can be called again."""
        if not self._bus.is_open:
            return
        trouble: BaseException | None = None
        try:
            self._stop()
        except BaseException as error:  # also a second Ctrl-C: the watchdog process continues
            trouble = error
        self._bus.close()
        answered = self._guard.dismiss(at_rest=trouble is None)
        if isinstance(trouble, UnsafeError):  # the packet of the watchdog process has no effect either
            raise trouble
        if trouble and not answered:
            raise UnsafeError(f"{self}: could not be stopped: cut its power ({trouble})") from trouble
        if trouble and not isinstance(trouble, DeviceError):
            trouble.add_note(f"{self} {_IS_OFF}")
            raise trouble

    @property
    def lost_replies(self) -> int:
        """Number of damaged or missing replies."""
        return self._bus.lost_replies

    def warnings(self) -> tuple[str, ...]:
        """Return the problems at opening, with advice."""
        return self._warnings

    def spin(self, rate_rad_s: float) -> None:
        """Turn continuously; positive is counter-clockwise.

        An AX-12A has no speed loop: it gets the voltage of this rate without load.

        Raises:
            ServoSetupError: the servo is permanently set to move to angles.
            DeviceError: the motor does not reach the rate.
        """
        self._check_rate(rate_rad_s)
        self._enter(spins=True)
        self._observe()  # turns are counted from here
        self._watch()
        self._unit.write(self._table.wheel_speed, rate_rad_s)
        self._order = TurnOrder(rate_rad_s, math.copysign(math.inf, rate_rad_s))

    def sweep_to(self, angle_rad: float, rate_rad_s: float) -> None:
        """Move to an angle of the encoder at a rate (above 0); this resets the count of turns.

        Raises:
            ServoSetupError: the servo is permanently set to spin.
            DeviceError: the servo does not reach the angle or the rate.
        """
        table = self._table
        low_rad, high_rad = table.reach_rad
        if not low_rad <= angle_rad <= high_rad:
            span = f"{math.degrees(low_rad):.1f} .. {math.degrees(high_rad):.1f}"
            raise DeviceError(f"{self}: sweep to {math.degrees(angle_rad):.1f} deg: it reaches {span} deg")
        if not rate_rad_s > 0:
            raise DeviceError(f"{self}: sweep at {math.degrees(rate_rad_s):.1f} deg/s: choose a rate above 0")
        self._check_rate(rate_rad_s)
        self._enter(spins=False)
        self._observe()
        self._watch()
        self._unit.write(table.joint_speed, max(rate_rad_s, table.joint_speed.unit))  # count 0 means unlimited
        self._unit.write(table.goal, angle_rad + table.centre * table.position.unit)
        self._order = TurnOrder(rate_rad_s, angle_rad)

    def hold(self) -> None:
        """Hold the present position with torque on, from rest in the configured mode.

        An AX-12A in wheel mode is only not driven, as it has no speed loop.
        """
        self._observe()
        if self._spins is False:
            self._unit.write(self._table.goal, self._here())
        elif self._spins:
            self._unit.write(self._table.wheel_speed, 0.0)
        else:
            spinner = bool(mode_changes(self._unit, spins=False)) and not mode_changes(self._unit, spins=True)
            self._enter(spins=spinner)
        self._rest()

    def release(self) -> None:
        """Stop and turn the torque off."""
        self._stop()

    def read(self) -> ServoState:
        """Read the state in one transaction.

        Raises:
            DeviceFaultError: overload, overheating, voltage, or a stall; the servo was stopped, or a note reports that
                it did not confirm that.
            DeviceTimeoutError: no reply.
            ProtocolError: damaged replies.
            DeviceError: the watchdog process stopped it, as it was not read for two seconds.
        """
        if self._order and not self._guard.beat():
            self._neglected()
        state = self._observe()
        if self._order:
            self._order = self._follow(self._order, state)
        return state

    def _observe(self) -> ServoState:
        answer = self._unit.present()
        if answer.conditions:
            self._fault(self._reported_fault(answer))
        state = state_of(self._table, answer, spins=bool(self._spins), known=self._known, order=self._order)
        if not math.isnan(state.position_rad):
            self._known = state
        return state

    def _follow(self, order: TurnOrder, state: ServoState) -> TurnOrder | None:
        progress = follow(order, state, self.step_rad)
        if isinstance(progress, Stall):
            if not self._unit.has_torque():
                self._fault(f"it has restarted by itself, {state.voltage_V:.1f} V now: {_ADVICE['voltage']}")
            self._fault(f"{progress}, load {state.load:.0%}: {_ADVICE['overload']}")
        if progress is None:
            self._rest()
        return progress

    def _reported_fault(self, answer: ServoAnswer) -> str:
        """Return the reported faults with advice."""
        table, names = self._table, self._unit.reported_fault(answer) or ""
        volts, degC = table.pick(table.voltage, answer.data), table.pick(table.temperature, answer.data)
        broken = "switch its power off and on; if it occurs again, the servo is broken"
        advice = next((text for name, text in _ADVICE.items() if name in names), broken)
        return f"{names} at {volts:.1f} V, {degC:.0f} degC: {advice}"

    def _fault(self, what: str) -> NoReturn:
        error = DeviceFaultError(f"{self}: {what}")
        try:
            self._stop()
        except DeviceError as unsafe:
            error.add_note(UnsafeNote(f"{self} has not answered that its torque is off ({unsafe})"))
        raise error

    def _neglected(self) -> NoReturn:
        self._order, self._spins = None, None
        answered = self._guard.dismiss(at_rest=False)
        stopped = "so it was stopped" if answered else "and did not answer the order to stop: cut its power"
        neglected = f"not read for {SILENCE_S:g} s while it turned, {stopped}"
        raise DeviceError(f"{self}: {neglected}: read it more often, open it again")

    def _check_rate(self, rate_rad_s: float) -> None:
        fastest_rad_s = self._product.no_load_rpm * RPM
        if not abs(rate_rad_s) <= fastest_rad_s:
            fastest = f"at most {math.degrees(fastest_rad_s):.0f} deg/s, at {self._product.rated_v:g} V"
            raise DeviceError(f"{self}: rate {math.degrees(rate_rad_s):.1f} deg/s: {fastest} and without load")

    def _enter(self, *, spins: bool) -> None:
        """Enter wheel or joint mode, at rest with torque on."""
        table = self._table
        if spins is self._spins:
            return
        self._stop()
        set_agreed(self._unit, mode_changes(self._unit, spins=spins), self._undo_folder)
        if spins:
            self._unit.write(table.wheel_speed, 0.0)
        else:
            self._unit.write(table.joint_speed, _GENTLE_RAD_S)
            self._unit.write(table.goal, self._here())
            self._known = None
        self._unit.write(table.torque, 1)
        self._spins = spins

    def _watch(self) -> None:
        """Start both watchdogs."""
        if not self._guard.turning():
            self._neglected()
        if self._table.watchdog:
            self._unit.write(self._table.watchdog, SILENCE_S)

    def _rest(self) -> None:
        """Pause both watchdogs; the servo is at rest, or will be without further requests."""
        self._order = None
        self._guard.resting()
        if self._table.watchdog:
            self._unit.write(self._table.watchdog, 0.0)

    def _stop(self) -> None:
        self._spins, self._order = None, None
        self._unit.write(self._table.torque, 0)
        if self._unit.has_torque():  # a late goal turns the torque of a Feetech servo on again
            self._unit.write(self._table.torque, 0)
            if self._unit.has_torque():
                raise UnsafeError(f"{self}: its torque stays on: cut its power")
        self._rest()

    def _here(self) -> float:
        """Return the goal at the present position, without the turns that protocol 2.0 counts."""
        return self._unit.value(self._table.position) % ((self._table.last + 1) * self._table.position.unit)


def open_servo(
    port: str,
    model: str | None = None,
    servo_id: int | None = None,
    *,
    spins: bool | None = None,
    undo_folder: Path | None = None,
) -> ServoDriver:
    """Detect the servo on a port and prepare it, at rest without torque.

    Args:
        port: such as /dev/ttyUSB0; /dev/serial/by-id/... stays the same after a reconnection.
        model: expected catalogue name; None for any.
        servo_id: None if it is the only servo.
        spins: whether it will spin (True) or sweep (False), to check its mode; None if unknown.
        undo_folder: allows to write permanent settings, and gets the undo file.

    Raises:
        ServoSetupError: permanent settings must change, and `undo_folder` is None; the torque is off.
        DeviceError: no port, no servo, several servos, another model, or settings that it does not keep.
    """
    bus = open_bus(port)
    try:
        unit = find_servo(bus, model, servo_id, unmute="for good" if undo_folder else "until power-off")
        return ServoDriver(unit, prepare(unit, spins=spins, undo_folder=undo_folder), undo_folder)
    except BaseException:
        bus.close()
        raise

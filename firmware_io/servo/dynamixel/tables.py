"""Control tables of the Dynamixel.

Sources are ROBOTIS' e-manual pages ax/ax-12a, mx/mx-28, mx/mx-64, mx/mx-106, their second editions for protocol 2.0,
x/xl330-m288, x/xc330-m288, x/xc330-t288, x/xl430-w250, x/xh430-w350, x/xm430-w350 and x/xm540-w270; numbers of models
and currents agree with the parameters of ROBOTIS' hardware interface for ROS 2. Load is the current relative to the
stall current at 12 V (models M288: 5 V); the XL430 and MX-28 measure none and report their duty.
"""

from __future__ import annotations

import math

from scanwright.firmware_io.servo.bus.registers import RPM, ControlTable, Register
from scanwright.firmware_io.servo.dynamixel.packets import PROTOCOL_1, PROTOCOL_2

_NUMBER = Register(0, 2)
_CLOCKWISE = 10  # sign bit of protocol 1.0
_DELAY_NS = 2000.0  # one count of the return delay
_LOAD = 0.001  # duty, of models that measure no current
_BAUDS_1 = {
    1: 1_000_000,
    3: 500_000,
    4: 400_000,
    7: 250_000,
    9: 200_000,
    16: 115_200,
    34: 57_600,
    103: 19_200,
    207: 9600,
}
_BAUDS_1_MX = {250: 2_250_000, 251: 2_500_000, 252: 3_000_000}
_BAUDS_2 = {0: 9600, 1: 57_600, 2: 115_200, 3: 1_000_000, 4: 2_000_000, 5: 3_000_000, 6: 4_000_000, 7: 4_500_000}
_MODES_2 = {
    **{0: "current control", 1: "velocity control", 3: "position control", 4: "extended position control"},
    **{5: "current-based position control", 16: "PWM control"},
}
_FAULTS_1 = {0: "voltage", 2: "overheating", 5: "overload"}
_FAULTS_2 = {0: "voltage", 2: "overheating", 3: "motor encoder", 4: "electrical shock", 5: "overload"}


def _protocol_1(model: str, number: int, *, step_deg: float, last: int, speed_rpm: float) -> ControlTable:
    ax = model == "AX-12A"
    drive_mode = ((Register(10, 1, name="drive_mode"), 0),) if model == "MX-106" else ()  # it can follow another servo
    clockwise = Register(6, 2, name="cw_angle_limit")
    counterclockwise = Register(8, 2, name="ccw_angle_limit")
    step_rad = math.radians(step_deg)
    # In wheel mode the AX-12A gets a part of the voltage: the same part of its 59 rpm without load, at 12 V.
    wheel_unit = 59 * RPM / 1023 if ax else speed_rpm * RPM
    return ControlTable(
        model=model,
        packets=PROTOCOL_1,
        number=number,
        ram=24,
        centre=(last + 1) // 2,
        last=last,
        measures_turn=not ax,
        speed_loop=not ax,
        wheel=((clockwise, 0), (counterclockwise, 0)),
        joint=((clockwise, 0), (counterclockwise, last)),
        neutral=()
        if ax
        else (
            *drive_mode,
            (Register(20, 2, sign="twos", name="multi_turn_offset"), 0),
            (Register(22, 1, name="resolution_divider"), 1),
        ),
        bauds=_BAUDS_1 if ax else _BAUDS_1 | _BAUDS_1_MX,
        answers_all=2,
        faults=_FAULTS_1,
        model_number=_NUMBER,
        id=Register(3, 1, name="id"),
        baud=Register(4, 1, name="baud_rate"),
        return_delay_ns=Register(5, 1, _DELAY_NS, name="return_delay_time"),
        status_return=Register(16, 1, name="status_return_level"),
        torque=Register(24, 1),
        wheel_speed=Register(32, 2, wheel_unit, _CLOCKWISE),
        joint_speed=Register(32, 2, speed_rpm * RPM),
        goal=Register(30, 2, step_rad),
        load=Register(40, 2, 0.001, _CLOCKWISE),
        velocity=Register(38, 2, speed_rpm * RPM, _CLOCKWISE),
        position=Register(36, 2, step_rad),
        voltage=Register(42, 1, 0.1),
        temperature=Register(43, 1),
        torque_limit=Register(34, 2, 0.001),
        max_torque=Register(14, 2, 0.001),
    )


def _protocol_2(model: str, number: int, *, load: float, most_baud: int = 4_500_000) -> ControlTable:
    mode, speed, step_rad = Register(11, 1, name="operating_mode"), 0.229 * RPM, 2 * math.pi / 4096
    return ControlTable(
        model=model,
        packets=PROTOCOL_2,
        number=number,
        ram=64,
        centre=2048,
        last=4095,
        measures_turn=True,
        speed_loop=True,
        wheel=((mode, 1),),
        joint=((mode, 3),),
        neutral=((Register(10, 1, name="drive_mode"), 0), (Register(20, 4, sign="twos", name="homing_offset"), 0)),
        bauds={count: baud for count, baud in _BAUDS_2.items() if baud <= most_baud},
        answers_all=2,
        faults=_FAULTS_2,
        model_number=_NUMBER,
        id=Register(7, 1, name="id"),
        baud=Register(8, 1, name="baud_rate"),
        return_delay_ns=Register(9, 1, _DELAY_NS, name="return_delay_time"),
        status_return=Register(68, 1, name="status_return_level"),
        torque=Register(64, 1),
        wheel_speed=Register(104, 4, speed, "twos"),
        joint_speed=Register(112, 4, speed),
        goal=Register(116, 4, step_rad, "twos"),
        load=Register(126, 2, load, "twos"),
        velocity=Register(128, 4, speed, "twos"),
        position=Register(132, 4, step_rad, "twos"),
        voltage=Register(144, 2, 0.1),
        temperature=Register(146, 1),
        hardware_error=Register(70, 1),
        watchdog=Register(98, 1, 0.020),
        modes=_MODES_2,
    )


def _current(count_mA: float, stall_A: float) -> float:
    """Return the fraction of the stall torque of one count of current."""
    return count_mA / 1000 / stall_A


TABLES = (
    _protocol_1("AX-12A", 12, step_deg=300 / 1024, last=1023, speed_rpm=0.111),
    _protocol_1("MX-28", 29, step_deg=360 / 4096, last=4095, speed_rpm=0.114),
    _protocol_1("MX-64R", 310, step_deg=360 / 4096, last=4095, speed_rpm=0.114),
    _protocol_1("MX-106", 320, step_deg=360 / 4096, last=4095, speed_rpm=0.114),
    _protocol_2("MX-28", 30, load=_LOAD),
    _protocol_2("MX-64R", 311, load=_current(3.36, 4.1)),
    _protocol_2("MX-106", 321, load=_current(3.36, 5.2)),
    _protocol_2("XH430-W350", 1000, load=_current(2.69, 1.3)),
    _protocol_2("XM430-W350", 1020, load=_current(2.69, 2.3)),
    _protocol_2("XL430-W250", 1060, load=_LOAD),
    _protocol_2("XM540-W270", 1120, load=_current(2.69, 4.4)),
    _protocol_2("XL330-M288", 1200, load=_current(1.0, 1.47), most_baud=4_000_000),
    _protocol_2("XC330-T288", 1220, load=_current(1.0, 0.88), most_baud=4_000_000),
    _protocol_2("XC330-M288", 1240, load=_current(1.0, 1.80), most_baud=4_000_000),
)

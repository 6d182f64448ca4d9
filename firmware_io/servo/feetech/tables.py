"""Control table of the Feetech STS3215.

Sources: Feetech's memory table of the STS and SMS, its SDK (`sms_sts`) and LeRobot's motor tables, which agree.
Negative numbers have a sign bit. Speeds are steps per second if bit 2 of register 18 ("phase") is set, as from the
factory. Counts grow clockwise seen towards the horn according to one user: check yours. Writes below address 40 are
permanent only while `lock` is 0. There is no watchdog.
"""

from __future__ import annotations

import math

from scanwright.firmware_io.servo.bus.registers import ControlTable, Register
from scanwright.firmware_io.servo.feetech.packets import STS

_STEP_RAD = 2 * math.pi / 4096  # of its encoder
_MODE = Register(33, 1, name="mode")
_LOWEST, _HIGHEST = Register(9, 2, name="min_angle_limit"), Register(11, 2, name="max_angle_limit")

TABLES = (
    ControlTable(
        model="STS3215",
        packets=STS,
        number=777,
        ram=40,
        centre=2048,
        last=4095,
        measures_turn=True,
        speed_loop=True,
        wheel=((_MODE, 1),),
        joint=((_MODE, 0), (_LOWEST, 0), (_HIGHEST, 4095)),
        neutral=(
            (Register(30, 1, name="angle_resolution"), 1),
            (Register(31, 2, sign=11, name="position_offset"), 0),
        ),
        bauds={
            **{0: 1_000_000, 1: 500_000, 2: 250_000, 3: 128_000},
            **{4: 115_200, 5: 76_800, 6: 57_600, 7: 38_400},
        },
        answers_all=1,
        faults={0: "voltage", 1: "encoder", 2: "overheating", 3: "overcurrent", 5: "overload"},
        model_number=Register(3, 2),
        id=Register(5, 1, name="id"),
        baud=Register(6, 1, name="baud_rate"),
        return_delay_ns=Register(7, 1, 2000.0, name="return_delay_time"),
        status_return=Register(8, 1, name="status_return_level"),
        torque=Register(40, 1),
        wheel_speed=Register(46, 2, -_STEP_RAD, 15),
        joint_speed=Register(46, 2, _STEP_RAD),
        goal=Register(42, 2, -_STEP_RAD, 15),
        load=Register(60, 2, -0.001, 10),
        velocity=Register(58, 2, -_STEP_RAD, 15),
        position=Register(56, 2, -_STEP_RAD, 15),
        voltage=Register(62, 1, 0.1),
        temperature=Register(63, 1),
        torque_limit=Register(48, 2, 0.001),
        max_torque=Register(16, 2, 0.001),
        lock=Register(55, 1),
        modes={0: "position", 1: "wheel", 2: "open loop", 3: "steps"},
    ),
)

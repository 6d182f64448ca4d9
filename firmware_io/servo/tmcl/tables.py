"""Parameters of Trinamic's PD42-3-1140, a NEMA 17 stepper with the TMCM-1140 and its encoder (sensOstep) on its back.

Sources: numbers and names of the parameters are those of the maker's own client (PyTrinamic 0.2.26, TMCM1140). The
speed is f = 16 MHz v / (2^d 2048 32) microsteps a second, v up to 2047 (PD42-x-1140 hardware manual V1.03, 11.1).
Parameter 140 = 8 is 256 microsteps, and then 210 = 25600 scales the encoder's 1024 counts to them (TMCM-1161 firmware
manual V1.19, 6.2, and TMCM-1021 V1.42, 6.2.1: the same encoder). Input 9 is the temperature (TMCM-1021).

From memory, so look at yours: numbers of the baud rates, input 8 for the voltage, bits of 207 and 208, that 167 = 0
takes the torque, that "right" is clockwise as one looks at the shaft, that 215 is the encoder's angle in its turn.
The counter of 209 begins at 0 with the power: who measures by it loses the angle in a brown-out, so it is set from
215 here. User variable 255 is gone with the power, too, and tells whether the torque is of this driver: a module has
it from the start.

The module stops on silence only where global parameter 68 is set, and that wears its memory: the guard stops it.
"""

from __future__ import annotations

import math

from scanwright.firmware_io.servo.bus.registers import ControlTable, Register
from scanwright.firmware_io.servo.tmcl.packets import (
    AXIS,
    FIRMWARE_VERSION,
    GLOBAL,
    INPUT,
    MOVE_TO,
    ROTATE_RIGHT,
    TMCL,
    USER,
)

_PULSE_DIVISOR = 3
_MICROSTEP_RAD = 2 * math.pi / (200 * 256)
_SPEED_RAD_S = 16e6 / (2**_PULSE_DIVISOR * 2048 * 32) * _MICROSTEP_RAD
_STEPPING = ((Register(AXIS + 154, 4, name="pulse_divisor"), _PULSE_DIVISOR),)


def _axis(number: int, unit: float = 1.0, name: str = "") -> Register:
    return Register(AXIS + number, 4, unit, "twos", name)


TABLES = (
    ControlTable(
        model="PD42-3-1140",
        packets=TMCL,
        number=1140,
        ram=0,
        kept=range(GLOBAL, USER),  # a global parameter is stored as it is set, one of the axis only by a command
        centre=512,
        last=1023,
        measures_turn=True,
        speed_loop=True,
        wheel=_STEPPING,
        joint=_STEPPING,
        neutral=(
            (_axis(140, name="microstep_resolution"), 8),
            (_axis(210, name="encoder_prescaler"), 25_600),
            (Register(GLOBAL + 90, 4, name="reverse_shaft"), 0),
        ),
        bauds={
            **{0: 9600, 1: 14_400, 2: 19_200, 3: 28_800, 4: 38_400, 5: 57_600, 6: 76_800, 7: 115_200},
            **{8: 230_400, 9: 250_000, 10: 500_000, 11: 1_000_000},
        },
        answers_all=1,
        faults={0: "overload", 1: "steps lost by overload", 9: "overheating", 11: "short circuit", 12: "short circuit"},
        model_number=Register(FIRMWARE_VERSION, 2),
        id=Register(GLOBAL + 66, 4, name="serial_address"),
        baud=Register(GLOBAL + 65, 4, name="serial_baud_rate"),
        return_delay_ns=Register(GLOBAL + 75, 4, 1e6, name="telegram_pause_time"),
        status_return=None,
        torque=_axis(167, name="chopper_off_time"),
        torque_on=5,
        wheel_speed=Register(ROTATE_RIGHT, 4, -_SPEED_RAD_S, "twos"),
        joint_speed=_axis(4, _SPEED_RAD_S),
        goal=Register(MOVE_TO, 4, -_MICROSTEP_RAD, "twos"),
        load=None,
        velocity=_axis(3, -_SPEED_RAD_S),
        position=_axis(215, -2 * math.pi / 1024),
        voltage=Register(INPUT + 8, 4, 0.1),
        temperature=Register(INPUT + 9, 4, 1.0, "twos"),
        scattered=True,
        alarms=(_axis(207), _axis(208)),
        driven=Register(USER + 255, 4),
        counters=(_axis(209, -_MICROSTEP_RAD), _axis(1, -_MICROSTEP_RAD)),
    ),
)

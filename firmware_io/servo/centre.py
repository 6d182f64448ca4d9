"""A servo at the centre of its encoder: the position in which the parts are put on its horn."""

from __future__ import annotations

import math

from scanwright.firmware_io.servo.servo import open_servo

_RATE_RAD_S = 0.5
_AT_REST_RAD_S = 0.02
_NEAR_RAD = math.radians(5.0)


def turn_to_centre(port: str, model: str | None = None, servo_id: int | None = None) -> float:
    """Turn the horn to the centre, switch the torque off, and return the position that it reached [rad].

    Arguments and errors as for `open_servo`; DeviceFaultError if the horn is blocked.
    """
    with open_servo(port, model, servo_id, spins=False) as servo:
        servo.sweep_to(0.0, _RATE_RAD_S)
        state = servo.read()
        while abs(state.position_rad) > _NEAR_RAD or abs(state.velocity_rad_s) > _AT_REST_RAD_S:
            state = servo.read()
        return state.position_rad

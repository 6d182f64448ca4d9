"""Model of a servo: motor, gear with backlash, control loop, and an off-axis mass.

All quantities refer to the horn. With motor angle m, horn angle h, duty u of the supply s:

    J_m m'' = T_stall (s u - m' / w_0) - T_c tanh(m' / eps) - T_gear
    J_h h'' = T_gear + T_g cos(h + phase) - T_b tanh(h' / eps)
    T_gear  = k d max(0, 1 + mu d' sign d),   d = (m - h) outside of the backlash, 0 within

The encoder on the output shaft has a delay. In velocity mode the control loop is a PI loop; in position mode it is a
proportional one towards a setpoint that moves at the set rate (MX, XM), or the AX-12A's compliance: nothing within one
count, then a smallest current ("punch") and a steep slope. That slope with a slow sensor leaves little phase margin: an
AX-12A overshoots and oscillates at the ends of a sweep, an MX-64R does not.

Motor data are the catalogue's; unpublished values are marked as assumed in `plant_of`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from scanwright.design.arrays import Floats
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.servo import Servo
from scanwright.firmware_io.servo.bus.registers import RPM

Mode = Literal["off", "share", "velocity", "position"]
_PLASTIC_TEETH = ("AX-12A", "XL330-M288", "XL430-W250")
_SLOW_RAD_S = 1e-4  # below it Coulomb friction decreases, so that its slope is finite for the solver


@dataclass(frozen=True, slots=True)
class Load:
    """Load of the horn."""

    inertia_kg_m2: float = 5e-4  # about the axis
    gravity_nm: float = 0.0  # largest torque of gravity on the axis; 0 for an upright axis or a balanced head
    gravity_phase_rad: float = 0.0  # that torque is `gravity_nm cos(angle + gravity_phase_rad)`
    bearing_nm: float = 0.01  # Coulomb friction of bearing and slip ring


@dataclass(frozen=True, slots=True)
class Plant:
    """One servo with its control loop."""

    stall_torque_nm: float  # at full supply
    no_load_rad_s: float  # at full supply
    inertia_kg_m2: float  # of rotor and gear
    friction_nm: float  # Coulomb friction of motor and gear
    backlash_rad: float  # of the gear, end to end
    stiffness_nm_rad: float  # of the teeth
    impact_s_rad: float  # damping of the teeth (mu above)
    sensor_lag_s: float  # delay of the measured angle of the horn
    velocity_p: float  # duty per rad/s of speed error
    velocity_i: float  # duty per rad of the error's integral
    position_p: float  # duty per rad of position error
    margin_rad: float  # position error that the loop ignores
    punch: float  # smallest duty beyond the margin


def plant_of(model: str) -> Plant:
    """Return the plant of a model: torque, speed and backlash from its maker, loop gains from its control table."""
    ax = model == "AX-12A"
    servo = load_catalogue().get(model, Servo)
    no_load_rad_s, backlash_deg = servo.no_load_rpm * RPM, servo.backlash_deg
    if backlash_deg is None:
        backlash_deg = 0.5 if ax else 0.333  # assumed
    # Assumed, mechanical time constants: rotors of 0.3 and 1 g cm2, geared 254:1 (AX-12A) and 200:1 (MX-64R).
    time_constant_s = 0.0082 if ax else 0.0044
    count_rad = math.radians(300 / 1024 if ax else 360 / 4096)
    return Plant(
        stall_torque_nm=servo.stall_torque_nm,
        no_load_rad_s=no_load_rad_s,
        inertia_kg_m2=time_constant_s * servo.stall_torque_nm / no_load_rad_s,
        # MX-64: 0.090 N m, MX-106: 0.104 (identified, github.com/Rhoban/bam); the others are assumed to be alike
        friction_nm=0.015 * servo.stall_torque_nm,
        backlash_rad=math.radians(backlash_deg),
        stiffness_nm_rad=100.0 if model in _PLASTIC_TEETH else 300.0,  # assumed
        impact_s_rad=20.0,  # assumed
        sensor_lag_s=0.030 if ax else 0.004,  # assumed: potentiometer with filter, encoder
        velocity_p=0.5 / no_load_rad_s,  # assumed, with the next one: some 20 rad/s of bandwidth
        velocity_i=20.0 / no_load_rad_s,
        position_p=1 / (32 * count_rad) if ax else 4 / (1023 * count_rad),  # slope 32; P gain 32, which is 4 per count
        margin_rad=count_rad if ax else 0.0,
        punch=32 / 1023 if ax else 0.0,
    )


@dataclass(frozen=True, slots=True)
class Actuation:
    """Input of the plant from one time on."""

    mode: Mode = "off"  # motor open, part of the supply, velocity or position loop
    goal: float = 0.0  # nothing, a duty in -1..1, rad/s or rad
    rate_rad_s: float = math.inf  # of the setpoint in position mode
    supply: float = 1.0  # voltage as a fraction of the rated one
    torque_limit: float = 1.0  # largest duty
    blocked: bool = False  # whether the horn is blocked


def walked_rad(elapsed_s: float, start: float, goal: float, rate_rad_s: float) -> float:
    """Return the setpoint [rad] on its way from `start` to `goal` after `elapsed_s`."""
    most_rad = rate_rad_s * elapsed_s if elapsed_s > 0 else 0.0
    return start + max(-most_rad, min(most_rad, goal - start))


def effort(
    plant: Plant,
    drive: Actuation,
    setpoint: float,
    m_rate: float,
    h: float,
    i: float,
    seen: float,
) -> tuple[float, float]:
    """Return the duty of the loop, and the torque of the motor as a fraction of the stall torque.

    `setpoint` is that of a position loop [rad], the others are states as in `equations`.
    """
    if drive.mode == "off":
        return 0.0, 0.0
    duty = max(-drive.torque_limit, min(drive.torque_limit, _unlimited_duty(plant, drive, setpoint, h, i, seen)))
    return duty, drive.supply * duty - m_rate / plant.no_load_rad_s


def _unlimited_duty(plant: Plant, drive: Actuation, setpoint: float, h: float, i: float, seen: float) -> float:
    """Return the duty of the loop without limit."""
    if drive.mode == "share":
        return drive.goal
    if drive.mode == "velocity":
        return plant.velocity_p * (drive.goal - (h - seen) / plant.sensor_lag_s) + i
    error = setpoint - seen
    beyond = abs(error) - plant.margin_rad
    return math.copysign(plant.punch + plant.position_p * beyond, error) if beyond > 0 else 0.0


def equations(
    plant: Plant, load: Load, drive: Actuation, start_s: float, setpoint: float, hold_rad: float
) -> Callable[[float, Floats], list[float]]:
    """Return the right-hand side for one drive; states: motor angle and rate, those of the horn, integral, encoder."""
    half = plant.backlash_rad / 2

    def rhs(t: float, y: Floats) -> list[float]:
        m, m_rate, h, h_rate, i, seen = y.tolist()
        duty, torque = effort(
            plant, drive, walked_rad(t - start_s, setpoint, drive.goal, drive.rate_rad_s), m_rate, h, i, seen
        )
        twist = m - h
        bite = twist - half if twist > half else twist + half if twist < -half else 0.0
        damped = 1 + plant.impact_s_rad * math.copysign(m_rate - h_rate, (m_rate - h_rate) * bite)
        gear = plant.stiffness_nm_rad * bite * max(0.0, damped)
        friction = plant.friction_nm * math.tanh(m_rate / _SLOW_RAD_S)
        on_horn = load.gravity_nm * math.cos(h + load.gravity_phase_rad) - load.bearing_nm * math.tanh(
            h_rate / _SLOW_RAD_S
        )
        if drive.blocked:
            on_horn -= 50 * plant.stall_torque_nm * (h - hold_rad) + 0.5 * plant.stall_torque_nm * h_rate
        seen_rate = (h - seen) / plant.sensor_lag_s
        integral_rate = 0.0
        if drive.mode == "velocity":
            # Anti-windup by back-calculation: an integral that stops at the limit would switch at every step of the
            # solver.
            cut = duty - _unlimited_duty(plant, drive, setpoint, h, i, seen)
            integral_rate = plant.velocity_i * (drive.goal - seen_rate + cut / plant.velocity_p)
        return [
            m_rate,
            (plant.stall_torque_nm * torque - friction - gear) / plant.inertia_kg_m2,
            h_rate,
            (gear + on_horn) / load.inertia_kg_m2,
            integral_rate,
            seen_rate,
        ]

    return rhs

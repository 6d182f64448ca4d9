"""How a servo's horn really turns: motor, gear with play, control loop, and an off-axis mass that gravity pulls.

All quantities are seen at the horn. With motor angle m, horn angle h, duty u of the supply s:

    J_m m'' = T_stall (s u - m' / w_0) - T_c tanh(m' / eps) - T_gear
    J_h h'' = T_gear + T_g cos(h + phase) - T_b tanh(h' / eps)
    T_gear  = k d max(0, 1 + mu d' sign d),   d = (m - h) outside of the play, 0 within

The control loop sees the horn through a sensor lag (the encoder sits on the output shaft). In velocity mode it is a PI
loop, in position mode a proportional one towards a goal that walks at the set rate (MX, XM), or the AX-12A's
compliance: nothing within one count, then a least current ("punch") and a steep slope. That slope behind a slow sensor
leaves little phase margin: an AX-12A overshoots and rings wherever a sweep begins and ends, an MX-64R does not.

The gear's teeth are stiff (`stiffness_nm_rad` on a rotor of some 1e-3 kg m2: a millisecond) against turns of seconds,
so a stiff solver integrates it, only as far as somebody asks. Motor data are the catalogue's; what no maker publishes
is assumed, and marked so in `plant_of`.
"""

from __future__ import annotations

import bisect
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray
from scipy.integrate import BDF, LSODA, Radau

from design.arrays import Floats
from design.catalogue.catalogue import load_catalogue
from design.catalogue.products import Servo
from firmware_io.servo.bus.registers import RPM

Mode = Literal["off", "share", "velocity", "position"]

_PLASTIC_TEETH = ("AX-12A", "XL330-M288", "XL430-W250")
_SLOW_RAD_S = 1e-4  # below it Coulomb friction fades, so that it has a slope a solver can follow
_SOLVERS = {"LSODA": LSODA, "Radau": Radau, "BDF": BDF}


@dataclass(frozen=True, slots=True)
class Load:
    """What hangs on the horn.

    Attributes:
        inertia_kg_m2: about the axis.
        gravity_nm: largest torque of gravity on the axis; 0 where the axis is upright or the head balanced.
        gravity_phase_rad: that torque is `gravity_nm cos(angle + gravity_phase_rad)`.
        bearing_nm: Coulomb friction of bearing and slip ring.
    """

    inertia_kg_m2: float = 5e-4
    gravity_nm: float = 0.0
    gravity_phase_rad: float = 0.0
    bearing_nm: float = 0.01


@dataclass(frozen=True, slots=True)
class Plant:
    """One servo with its control loop.

    Attributes:
        stall_torque_nm: at full supply.
        no_load_rad_s: at full supply.
        inertia_kg_m2: of rotor and gear.
        friction_nm: Coulomb friction of motor and gear.
        backlash_rad: full play of the gear.
        stiffness_nm_rad: of the teeth.
        impact_s_rad: how much of a hit the teeth swallow (mu above).
        sensor_lag_s: between the horn's angle and what the loop knows of it.
        velocity_p: duty per rad/s of speed error.
        velocity_i: duty per rad of the error's integral.
        position_p: duty per rad of position error.
        margin_rad: position error that the loop ignores.
        punch: least duty beyond the margin.
    """

    stall_torque_nm: float
    no_load_rad_s: float
    inertia_kg_m2: float
    friction_nm: float
    backlash_rad: float
    stiffness_nm_rad: float
    impact_s_rad: float
    sensor_lag_s: float
    velocity_p: float
    velocity_i: float
    position_p: float
    margin_rad: float
    punch: float


def plant_of(model: str) -> Plant:
    """The plant of a model: torque, speed and play from its maker, loop gains from its control table's defaults."""
    ax = model == "AX-12A"
    servo = load_catalogue().get(model, Servo)
    no_load_rad_s, play_deg = servo.no_load_rpm * RPM, servo.backlash_deg
    if play_deg is None:
        play_deg = 0.5 if ax else 0.333  # assumed
    # Assumed, mechanical time constants: rotors of 0.3 and 1 g cm2, geared 254:1 (AX-12A) and 200:1 (MX-64R).
    time_constant_s = 0.0082 if ax else 0.0044
    count_rad = math.radians(300 / 1024 if ax else 360 / 4096)
    return Plant(
        stall_torque_nm=servo.stall_torque_nm,
        no_load_rad_s=no_load_rad_s,
        inertia_kg_m2=time_constant_s * servo.stall_torque_nm / no_load_rad_s,
        friction_nm=(0.015 if ax else 0.05) * servo.stall_torque_nm,  # assumed
        backlash_rad=math.radians(play_deg),
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
    """What acts on the plant from one moment on.

    Attributes:
        mode: motor open, share of the supply, velocity or position loop.
        goal: nothing, a duty in -1..1, rad/s or rad.
        rate_rad_s: at which the goal position is walked to.
        supply: voltage as a fraction of the rated one.
        torque_limit: largest duty.
        blocked: something holds the horn where it is.
    """

    mode: Mode = "off"
    goal: float = 0.0
    rate_rad_s: float = math.inf
    supply: float = 1.0
    torque_limit: float = 1.0
    blocked: bool = False


@dataclass(frozen=True, slots=True)
class Motion:
    """The horn at one moment; `duty` is what the loop puts out, `torque` what the motor gives, as fractions."""

    angle_rad: float
    rate_rad_s: float
    duty: float
    torque: float


@dataclass(frozen=True, slots=True)
class Solver:
    """How the motion is integrated: method and relative tolerance; the absolute one is a thousandth of it (rad)."""

    method: Literal["LSODA", "Radau", "BDF"] = "LSODA"
    rtol: float = 1e-6


class HornMotion:
    """The horn's motion under a history of drives, integrated lazily and kept for `history_s`.

    Times are integer nanoseconds of whatever clock the caller uses. Thread-safe.
    """

    def __init__(
        self,
        plant: Plant,
        load: Load,
        time_ns: int,
        *,
        angle_rad: float = 0.0,
        solver: Solver | None = None,
        history_s: float = 60.0,
    ) -> None:
        self._plant, self._load = plant, load
        self._solver = Solver() if solver is None else solver
        self._history_s = history_s
        self._origin_ns = time_ns
        self._lock = Lock()
        self._drives: list[tuple[float, Actuation, float, float]] = []  # start, drive, where the walk starts, block
        self._ends: list[float] = []  # of the steps, increasing
        self._steps: list[Callable[[Floats], Floats]] = []
        self._begin(0.0, np.array([angle_rad, 0.0, angle_rad, 0.0, 0.0, angle_rad]), Actuation(), angle_rad)

    def drive(self, time_ns: int, drive: Actuation) -> None:
        """From `time_ns` on, `drive` acts; what was integrated beyond is forgotten."""
        with self._lock:
            t = max((time_ns - self._origin_ns) / 1e9, self._drives[-1][0])
            state = self._states(np.array([t]))[:, 0]
            last_s, last, start, _ = self._drives[-1]
            walking = last.mode == drive.mode == "position"
            setpoint = _walk(t - last_s, start, last.goal, last.rate_rad_s) if walking else float(state[2])
            if drive.mode != "velocity" or last.mode != "velocity":
                state[4] = drive.goal / self._plant.no_load_rad_s if drive.mode == "velocity" else 0.0
            kept = bisect.bisect_left(self._ends, t) + 1
            del self._ends[kept:], self._steps[kept:]
            if self._ends:
                self._ends[-1] = min(self._ends[-1], t)
            self._begin(t, state, drive, setpoint)

    def change(self, time_ns: int, **values: object) -> None:
        """From `time_ns` on, these fields of the present drive are others."""
        self.drive(time_ns, replace(self._drives[-1][1], **values))  # type: ignore[arg-type]

    def drive_at(self, time_ns: int) -> Actuation:
        """The drive that acts at one time."""
        with self._lock:
            return self._drives[self._index((time_ns - self._origin_ns) / 1e9)][1]

    def angle_rad(self, time_ns: Int64[ndarray, " *k"]) -> Float64[ndarray, " *k"]:
        """True angle of the horn at given times, in the shape given.

        Raises:
            ValueError: a time lies before what is kept.
        """
        asked_s = (np.asarray(time_ns, np.int64) - self._origin_ns) / 1e9
        with self._lock:
            return self._states(asked_s.ravel())[2].reshape(asked_s.shape)

    def motion(self, time_ns: int) -> Motion:
        """Angle, rate and effort at one time."""
        t = (time_ns - self._origin_ns) / 1e9
        with self._lock:
            state = self._states(np.array([t]))[:, 0]
            start_s, drive, start, _ = self._drives[
                bisect.bisect_right(self._drives, t, key=lambda entry: entry[0]) - 1
            ]
        duty, torque = _effort(self._plant, drive, _walk(t - start_s, start, drive.goal, drive.rate_rad_s), *state)
        return Motion(float(state[2]), float(state[3]), duty, torque)

    def _index(self, t: float) -> int:
        """Of the drive that acts at `t`."""
        return max(0, bisect.bisect_right(self._drives, t, key=lambda entry: entry[0]) - 1)

    def _begin(self, t: float, state: Floats, drive: Actuation, setpoint: float) -> None:
        held = self._drives[-1][3] if self._drives and self._drives[-1][1].blocked else float(state[2])
        self._drives.append((t, drive, setpoint, held))
        rhs = _equations(self._plant, self._load, drive, t, setpoint, held)
        rtol = self._solver.rtol
        # No upper end: steps are taken as they are asked for. First steps are short, as a drive begins with a jump.
        self._integrator = _SOLVERS[self._solver.method](
            rhs, t, state, t + 1e9, rtol=rtol, atol=rtol / 1000, first_step=1e-6, max_step=1.0
        )

    def _states(self, asked_s: Floats) -> Floats:
        """States at given times, shape (6, n); integrates as far as needed."""
        if asked_s.size == 0:
            return np.empty((6, 0))
        if asked_s.min() < self._first_s():
            raise ValueError(f"the motion {asked_s.min() - self._first_s():.3f} s before what is kept is gone")
        last = float(asked_s.max())
        while self._integrator.t < last:
            self._integrator.step()
            if self._integrator.status == "failed":
                raise ArithmeticError(f"the solver gave up at {self._integrator.t:.6f} s")
            self._ends.append(self._integrator.t)
            self._steps.append(self._integrator.dense_output())
        states = np.empty((6, asked_s.size))
        which = np.searchsorted(self._ends, asked_s) if self._ends else np.zeros(asked_s.size, int)
        for step in np.unique(which):
            here = which == step
            states[:, here] = self._steps[step](asked_s[here]) if self._ends else self._integrator.y[:, None]
        self._forget(last - self._history_s)
        return states

    def _first_s(self) -> float:
        return float(self._steps[0].t_old) if self._steps else self._drives[0][0]  # type: ignore[attr-defined]

    def _forget(self, before_s: float) -> None:
        gone = bisect.bisect_left(self._ends, before_s)
        if gone > 1000:  # in bulk, so that it costs nothing per step
            del self._ends[:gone], self._steps[:gone]
            del self._drives[: self._index(self._first_s())]


def _walk(elapsed_s: float, start: float, goal: float, rate_rad_s: float) -> float:
    """Where the goal position has walked to."""
    way = rate_rad_s * elapsed_s if elapsed_s > 0 else 0.0
    return start + max(-way, min(way, goal - start))


def _effort(
    plant: Plant,
    drive: Actuation,
    setpoint: float,
    m: float,
    m_rate: float,
    h: float,
    h_rate: float,
    i: float,
    seen: float,
) -> tuple[float, float]:
    """Duty of the loop, and torque of the motor as a fraction of the stall torque."""
    del m, h_rate
    if drive.mode == "off":
        return 0.0, 0.0
    asked = _asked(plant, drive, setpoint, h, i, seen)
    duty = max(-drive.torque_limit, min(drive.torque_limit, asked))
    return duty, drive.supply * duty - m_rate / plant.no_load_rad_s


def _asked(plant: Plant, drive: Actuation, setpoint: float, h: float, i: float, seen: float) -> float:
    """Duty that the loop asks for, whatever the limit."""
    if drive.mode == "share":
        return drive.goal
    if drive.mode == "velocity":
        return plant.velocity_p * (drive.goal - (h - seen) / plant.sensor_lag_s) + i
    error = setpoint - seen
    beyond = abs(error) - plant.margin_rad
    return math.copysign(plant.punch + plant.position_p * beyond, error) if beyond > 0 else 0.0


def _equations(
    plant: Plant, load: Load, drive: Actuation, start_s: float, setpoint: float, held: float
) -> Callable[[float, Floats], list[float]]:
    """Right-hand side for one drive; states: motor angle and rate, horn angle and rate, integral, angle seen."""
    half = plant.backlash_rad / 2

    def rhs(t: float, y: Floats) -> list[float]:
        m, m_rate, h, h_rate, i, seen = y.tolist()
        duty, torque = _effort(
            plant, drive, _walk(t - start_s, setpoint, drive.goal, drive.rate_rad_s), m, m_rate, h, h_rate, i, seen
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
            on_horn -= 50 * plant.stall_torque_nm * (h - held) + 0.5 * plant.stall_torque_nm * h_rate
        seen_rate = (h - seen) / plant.sensor_lag_s
        integral_rate = 0.0
        if drive.mode == "velocity":
            # What the limit cuts off flows back. An integral that just stops there would switch at every step, and the
            # solver would crawl along the switch for ever.
            cut = duty - _asked(plant, drive, setpoint, h, i, seen)
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

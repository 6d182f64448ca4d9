"""True motion of a servo's horn: motor, gear with backlash, control loop and off-axis mass (`servo_plant.py`).

The teeth of the gear are stiff (a millisecond) compared with turns of seconds, so a stiff solver integrates.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray
from scipy.integrate import BDF, LSODA, Radau

from scanwright.design.arrays import Floats
from scanwright.firmware_io.emulators.servo_plant import Actuation, Load, Plant, effort, equations, walked_rad

_SOLVERS = {"LSODA": LSODA, "Radau": Radau, "BDF": BDF}


@dataclass(frozen=True, slots=True)
class Motion:
    """State of the horn at one time."""

    angle_rad: float
    rate_rad_s: float
    duty: float  # of the control loop, as a fraction
    torque: float  # of the motor, as a fraction of the stall torque


@dataclass(frozen=True, slots=True)
class Solver:
    """Method and relative tolerance of the integration; the absolute tolerance is a thousandth of it (rad)."""

    method: Literal["LSODA", "Radau", "BDF"] = "LSODA"
    rtol: float = 1e-6


class HornMotion:
    """The horn's motion under a history of drives, integrated on request and kept for `history_s`. Thread-safe."""

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
        self._drives: list[tuple[float, Actuation, float, float]] = []  # start, drive, first setpoint, blocked angle
        self._ends: list[float] = []  # of the steps, increasing
        self._steps: list[Callable[[Floats], Floats]] = []
        self._begin(0.0, np.array([angle_rad, 0.0, angle_rad, 0.0, 0.0, angle_rad]), Actuation(), angle_rad)

    def drive(self, time_ns: int, drive: Actuation) -> None:
        """Apply `drive` from `time_ns` on; drops the motion integrated beyond."""
        with self._lock:
            t = max((time_ns - self._origin_ns) / 1e9, self._drives[-1][0])
            state = self._states(np.array([t]))[:, 0]
            last_s, last, start, _ = self._drives[-1]
            walking = last.mode == drive.mode == "position"
            setpoint = walked_rad(t - last_s, start, last.goal, last.rate_rad_s) if walking else float(state[2])
            if drive.mode != "velocity" or last.mode != "velocity":
                state[4] = drive.goal / self._plant.no_load_rad_s if drive.mode == "velocity" else 0.0
            valid = bisect.bisect_left(self._ends, t) + 1
            del self._ends[valid:], self._steps[valid:]
            if self._ends:
                self._ends[-1] = min(self._ends[-1], t)
            self._begin(t, state, drive, setpoint)

    def change(self, time_ns: int, **values: object) -> None:
        """Change fields of the present drive from `time_ns` on."""
        self.drive(time_ns, replace(self._drives[-1][1], **values))  # type: ignore[arg-type]

    def drive_at(self, time_ns: int) -> Actuation:
        """Return the drive at one time."""
        with self._lock:
            return self._drives[self._index((time_ns - self._origin_ns) / 1e9)][1]

    def angle_rad(self, time_ns: Int64[ndarray, " *k"]) -> Float64[ndarray, " *k"]:
        """Return the true angle of the horn at given times, in their shape; ValueError before the history."""
        at_s = (np.asarray(time_ns, np.int64) - self._origin_ns) / 1e9
        with self._lock:
            return self._states(at_s.ravel())[2].reshape(at_s.shape)

    def motion(self, time_ns: int) -> Motion:
        """Return the state of the horn at one time."""
        t = (time_ns - self._origin_ns) / 1e9
        with self._lock:
            state = self._states(np.array([t]))[:, 0]
            start_s, drive, start, _ = self._drives[self._index(t)]
        setpoint = walked_rad(t - start_s, start, drive.goal, drive.rate_rad_s)
        duty, torque = effort(self._plant, drive, setpoint, *state[[1, 2, 4, 5]])
        return Motion(float(state[2]), float(state[3]), duty, torque)

    def _index(self, t: float) -> int:
        """Return the index of the drive at `t`."""
        return max(0, bisect.bisect_right(self._drives, t, key=lambda entry: entry[0]) - 1)

    def _begin(self, t: float, state: Floats, drive: Actuation, setpoint: float) -> None:
        hold_rad = self._drives[-1][3] if self._drives and self._drives[-1][1].blocked else float(state[2])
        self._drives.append((t, drive, setpoint, hold_rad))
        rhs = equations(self._plant, self._load, drive, t, setpoint, hold_rad)
        rtol = self._solver.rtol
        # No upper end: steps are made on request. The first ones are short, as a drive begins with a jump.
        self._integrator = _SOLVERS[self._solver.method](
            rhs, t, state, t + 1e9, rtol=rtol, atol=rtol / 1000, first_step=1e-6, max_step=1.0
        )

    def _states(self, at_s: Floats) -> Floats:
        """Return the states at given times, shape (6, n); integrates as far as needed."""
        if at_s.size == 0:
            return np.empty((6, 0))
        if at_s.min() < self._first_s():
            raise ValueError(f"the motion {self._first_s() - at_s.min():.3f} s before the history")
        last = float(at_s.max())
        while self._integrator.t < last:
            self._integrator.step()
            if self._integrator.status == "failed":
                raise ArithmeticError(f"the solver failed at {self._integrator.t:.6f} s")
            self._ends.append(self._integrator.t)
            self._steps.append(self._integrator.dense_output())
        states = np.empty((6, at_s.size))
        which = np.searchsorted(self._ends, at_s) if self._ends else np.zeros(at_s.size, int)
        for step in np.unique(which):
            here = which == step
            states[:, here] = self._steps[step](at_s[here]) if self._ends else self._integrator.y[:, None]
        outdated = bisect.bisect_left(self._ends, last - self._history_s)
        if outdated > 1000:  # in bulk, to cost nothing per step
            del self._ends[:outdated], self._steps[:outdated]
            del self._drives[: self._index(self._first_s())]
        return states

    def _first_s(self) -> float:
        return float(self._steps[0].t_old) if self._steps else self._drives[0][0]  # type: ignore[attr-defined]

"""Error against run time of the integrator behind the emulated servo (`dynamics.Solver`), over method and tolerance."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Literal

import numpy as np

from scanwright.design.accuracy.trials import Trial, timed
from scanwright.design.arrays import Floats
from scanwright.design.progress import Progress
from scanwright.firmware_io.emulators.dynamics import HornMotion, Solver
from scanwright.firmware_io.emulators.servo_plant import Actuation, Load, Plant

METHODS: tuple[Literal["LSODA", "Radau", "BDF"], ...] = ("LSODA", "Radau", "BDF")
TOLERANCES = 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8  # relative, of the integrator
REFERENCE = Solver("Radau", 1e-11)  # three digits better than the best trial, by another method than the default
SECONDS = 2.0  # of motion: from rest with an unbalanced head, through the backlash
RATE_RAD_S = math.pi
HEAD = Load(gravity_nm=0.2)  # of a lidar on a tilted axis


def solver_trials(plant: Plant, progress: Progress) -> Iterator[Trial]:
    """Measure each method at each tolerance; the error is the maximum deviation of the horn from the reference."""
    at_ns = np.arange(0, int(SECONDS * 1e9), 10_000_000)

    def run(solver: Solver) -> Floats:
        axis = HornMotion(plant, HEAD, 0, solver=solver)
        axis.drive(0, Actuation("velocity", RATE_RAD_S))
        return axis.angle_rad(at_ns)

    progress("motion of the servo, reference")
    true = run(REFERENCE)
    for method in METHODS:
        for rtol in TOLERANCES:
            progress(f"motion of the servo, {method} within {rtol:g}")
            solver = Solver(method, rtol)
            angle, seconds = timed(partial(run, solver))
            yield Trial(
                choice=f"{SECONDS:g} s of the emulated servo",
                method=method,
                setting=f"{rtol:g}",
                error=float(np.degrees(np.abs(angle - true).max())),
                unit="deg",
                seconds=seconds,
                chosen=solver == Solver(),
            )

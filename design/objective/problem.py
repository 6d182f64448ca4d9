"""A task as numbers, from which density and J are computed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Plane
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.density.beams import NO_LEVER, ScanLines, beam_directions_rot, blind_zones, scan_lines
from scanwright.design.density.sweep import SweepLines
from scanwright.design.errors import BuildError, TaskError
from scanwright.design.motion import Motion, Shortest, StopAndGo, Sweep
from scanwright.design.objective.named_objectives import Objective, objective_of
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.sphere.directions import EMPTY, equal_angle_grid, require_weight
from scanwright.design.sphere.regions import Field, field_of
from scanwright.design.task.task import LoadedTask

FRONT = Path(__file__).parent / "front.csv"
MANY_LINES = 100  # of a turn: rounding the number to an integer hardly changes J
NODES = 6561  # of the quadrature of one mount


@dataclass(frozen=True, slots=True)
class Problem:
    """A task as numbers."""

    bearings_rad: Float[ndarray, " beams"]  # of the beams
    lines: ScanLines  # of one full turn; of a sweep, as many as one period has, at the widest step
    sweep: SweepLines | None  # the trajectory, if the servo sweeps
    scan_rate_hz: float  # scan rate of the lidar
    ball_rad: float  # ball radius
    objective: Objective  # to minimise
    grid_step_deg: float | None  # step of the paper's equal-angle sum, or None for solid angles
    nodes: int = NODES  # initial quadrature nodes of a score, from the task's `tolerance` or `budget_s`
    tolerance: float = 1e-3  # largest error of J; a score uses more nodes until its error is smaller
    # offset of the optical centre from the axis, `t_rot_laser / range`; 0 by design and in the search
    lever: tuple[float, float, float] = NO_LEVER

    def beams_rot(self, plane_rad: Plane) -> Float[ndarray, "beams 3"]:
        """Return unit vectors of the beams in the rotation frame for (alpha_laser, beta_laser)."""
        return beam_directions_rot(self.bearings_rad, plane_rad[0], plane_rad[1], self.lever)

    def blind_zones(self, beam_polar_rad: Float[ndarray, " beams"]) -> Float[ndarray, "zones 2"]:
        """Return the ranges of the polar angle about the axis that are blind at every start phase."""
        return blind_zones(self.bearings_rad, beam_polar_rad, self.ball_rad)

    def joint_rad(self) -> Float[ndarray, " lines"]:
        """Return the axis angles of the lines of one full scan, of a sweep at a start phase of a half."""
        return self.lines.angles_rad if self.sweep is None else self.sweep.angles_rad(0.5)

    @property
    def field(self) -> Field:
        """Weights and masks of the task."""
        return self.objective.field

    def without_seam(self) -> Problem:
        """Return the problem with the nearest integer number of lines, if they are many.

        This changes J of all mounts nearly equally, and counts without a seam are ten times as fast.
        """
        if self.sweep is not None or self.lines.count < MANY_LINES:
            return self
        count = round(2 * np.pi / self.lines.step_rad)
        return replace(self, lines=replace(self.lines, count=count, step_rad=2 * np.pi / count))

    def with_objective(self, objective: Objective) -> Problem:
        """Return the problem with another objective."""
        return replace(self, objective=objective)

    def behind(self, shadow: SelfOcclusion) -> Problem:
        """Return the problem without the beams that are blocked by parts that turn with the laser.

        Raises:
            BuildError: the mask has another number of beams.
        """
        if len(shadow.beams) != len(self.bearings_rad):
            raise BuildError(
                f"own_body.npz: made for a lidar of {len(shadow.beams)} beams, the task has {len(self.bearings_rad)}: "
                "build the folder again"
            )
        return self.with_beams(self.bearings_rad[~shadow.beams], self.lines, self.sweep)

    def with_beams(
        self, bearings_rad: Float[ndarray, " beams"], lines: ScanLines, sweep: SweepLines | None = None
    ) -> Problem:
        """Return the problem with other beams and lines."""
        return replace(self, bearings_rad=bearings_rad, lines=lines, sweep=sweep)


def problem_of(loaded: LoadedTask) -> Problem:
    """Return the numbers of a task that determine J.

    Raises:
        TaskError: no direction has a weight, or the tolerance or the budget cannot be met.
    """
    density = loaded.task.density
    field = field_of(loaded)
    step_deg = density.grid_step_deg if density.quadrature == "equal_angle" else None
    try:
        nodes = nodes_for(density.tolerance, density.budget_s)
        if step_deg is None:
            require_weight(field)
        elif not field.weight_at(equal_angle_grid(step_deg)).any():
            raise TaskError(EMPTY)
    except TaskError as error:
        raise TaskError(f"{loaded.source}: {error}") from error
    motion, lidar = loaded.task.motion, loaded.lidar
    problem = Problem(
        bearings_rad=lidar.bearings_rad(),
        lines=motion_lines(motion, lidar.scan_rate_hz),
        sweep=None,
        scan_rate_hz=lidar.scan_rate_hz,
        ball_rad=float(np.radians(density.ball_radius_deg)),
        objective=objective_of(loaded, field),
        grid_step_deg=step_deg,
        nodes=nodes,
        tolerance=density.tolerance or (np.inf if density.budget_s else 1e-3),
    )
    return with_scanner(problem, lidar, motion)


def with_scanner(problem: Problem, lidar: Lidar, motion: Motion | Shortest) -> Problem:
    """Return the problem with another lidar and motion."""
    rate_hz = lidar.scan_rate_hz
    sweep = SweepLines(motion, rate_hz) if isinstance(motion, Sweep) else None
    seen = problem.with_beams(lidar.bearings_rad(), motion_lines(motion, rate_hz), sweep)
    return replace(seen, scan_rate_hz=rate_hz)


def motion_lines(motion: Motion | Shortest, scan_rate_hz: float) -> ScanLines:
    """Return the scan lines of a motion; for a sweep as many as one period has, at the widest step."""
    if isinstance(motion, StopAndGo):
        repeats = max(1, int(motion.dwell_s * scan_rate_hz + 1e-9))
        return ScanLines(motion.stops, 2 * np.pi / motion.stops, repeats)
    if isinstance(motion, Sweep):
        step = np.radians(motion.cruise_deg_s) / scan_rate_hz
        return ScanLines(int(np.ceil(motion.period_s * scan_rate_hz)), float(step))
    return scan_lines(motion.duration_s, scan_rate_hz)


def nodes_for(tolerance: float | None, budget_s: float | None) -> int:
    """Return the fewest nodes within a tolerance of J, or else the most within a time budget.

    Errors and times are in `design/objective/front.csv`, measured by `benchmarks/design/front.py`.

    Raises:
        TaskError: no number of nodes is that accurate, or that fast.
    """
    if tolerance is None and budget_s is None:
        return NODES
    front = np.loadtxt(FRONT, delimiter=",", skiprows=1)
    paid = front[front[:, 2] <= (np.inf if budget_s is None else budget_s)]
    if not len(paid):
        raise TaskError(f"density.budget_s = {budget_s:g}: the fastest score needs {front[:, 2].min():g} s")
    near = paid[paid[:, 1] <= (np.inf if tolerance is None else tolerance)]
    if not len(near):
        raise TaskError(f"density.tolerance = {tolerance:g}: the smallest possible is {paid[:, 1].min():g}")
    return int(near[-1, 0] if tolerance is None else near[0, 0])

"""Records of the `--json` output of `optimise`, `evaluate` and `compare`."""

from __future__ import annotations

from dataclasses import dataclass

from scanwright.design.evaluation.as_built import Seen
from scanwright.design.evaluation.comparison import ComparisonRow
from scanwright.design.evaluation.evaluation import Lever
from scanwright.design.evaluation.expected_cloud import ExpectedError
from scanwright.design.evaluation.gaps import BlindCone
from scanwright.design.evaluation.metres import PlaneFigures
from scanwright.design.evaluation.poles import PoleChances
from scanwright.design.findings import Finding
from scanwright.design.left_out import LeftOut
from scanwright.design.objective.holes import BlindSpot


@dataclass(frozen=True, slots=True)
class ObjectiveResult:
    """The objective of a mount: lower is better.

    Attributes:
        J: value.
        J_error: bound of its numerical error.
    """

    J: float | None
    J_error: float | None


@dataclass(frozen=True, slots=True)
class MountResult:
    """Mounting angles.

    Attributes:
        alpha_rot_deg: rotation axis, about x.
        beta_rot_deg: rotation axis, about y.
        alpha_laser_deg: lidar on the axis, about x.
        beta_laser_deg: lidar on the axis, about y.
        J: objective; lower is better.
        J_error: bound of its numerical error.
    """

    alpha_rot_deg: float
    beta_rot_deg: float
    alpha_laser_deg: float
    beta_laser_deg: float
    J: float
    J_error: float


@dataclass(frozen=True, slots=True)
class RankedMount(MountResult):
    """One of the best mounts.

    Attributes:
        settings: number of equivalent mounts.
        note: remark of the table, such as two axis directions; empty if there is none.
    """

    settings: int
    note: str


@dataclass(frozen=True, slots=True)
class Unconstrained(MountResult):
    """The mount with the lowest J if blind spots were allowed.

    Attributes:
        holes: its blind spots.
    """

    holes: list[BlindSpot]


@dataclass(frozen=True, slots=True)
class Preferred:
    """The price of a simple mount (`prefer = "simple"`).

    Attributes:
        accepted_loss: share of the beams that the task accepts to lose.
        J_more: J of the chosen mount minus the lowest J.
        lowest_J: the mount with the lowest J.
    """

    accepted_loss: float
    J_more: float
    lowest_J: MountResult  # noqa: N815  a key of the JSON object


@dataclass(frozen=True, slots=True)
class GainResult:
    """Gain over a reference mount without parts.

    Attributes:
        name: name of the reference mount.
        angles_deg: its alpha_rot, beta_rot, alpha_laser, beta_laser.
        factor: beams per direction of the optimum over those of the mount (geometric mean); null if J is no logarithm.
        J_less: J of the mount minus J of the optimum.
        J: objective of the mount.
        J_error: bound of its numerical error.
        least: lowest number of beams within the ball radius in the region.
        blind_weight: share of the weight that the mount never sees.
        keeps_limits: whether it keeps the limits of the task.
        in_ranges: whether the task allows its angles.
    """

    name: str
    angles_deg: list[float]
    factor: float | None
    J_less: float | None
    J: float | None
    J_error: float | None
    least: int
    blind_weight: float
    keeps_limits: bool
    in_ranges: bool


@dataclass(frozen=True, slots=True)
class SeenGain(GainResult):
    """Gain over a reference mount, and the view of that mount.

    Attributes:
        seen: view of the mount.
    """

    seen: Seen


@dataclass(frozen=True, slots=True)
class Optimised:
    """The best mounting angles of a task.

    Attributes:
        task: name of the task.
        with_parts: whether beams blocked by the parts are excluded; always false here.
        duration_s: time of one full scan.
        best: best distinct mounts, best first.
        holes: blind spots of the best mount.
        plain: the mount with the lowest J if blind spots were allowed; null if it is the best one.
        least_blind_weight: smallest blind share of the weight of any mount; null if the best mount has no blind spot.
        preferred: price of a simple mount; null if none was preferred.
        standard: the reference mounts, name -> objective.
        gains: gains over the reference mounts, the smallest first.
        covered: number of mounts that the search covers.
        evaluated: number of values of J that it computed.
        seconds: run time of the search.
        left_out: skipped work, with the reason.
        expected_error: error of a point to expect at 3 m.
        expected_error_far: the same at 5 m; null if the lidar does not reach it.
        wide_gap: warning of a gap much wider than the spacing of lines; null if there is none.
        missed_object: warning that an object as wide as a ball of the task can get no beam; null if none can.
        planes: points on ground, walls and ceilings of the task.
        hidden_regions: regions that the robot hides in part.
        warnings: limits of the task that can surprise.
    """

    task: str
    with_parts: bool
    duration_s: float
    best: list[RankedMount]
    holes: list[BlindSpot]
    plain: Unconstrained | None
    least_blind_weight: float | None
    preferred: Preferred | None
    standard: dict[str, ObjectiveResult]
    gains: list[GainResult]
    covered: int
    evaluated: int
    seconds: float
    left_out: list[LeftOut]
    expected_error: ExpectedError
    expected_error_far: ExpectedError | None
    wide_gap: Finding | None
    missed_object: Finding | None
    planes: list[PlaneFigures]
    hidden_regions: list[Finding]
    warnings: list[str]


@dataclass(frozen=True, slots=True)
class WithParts:
    """View of a built scanner.

    Attributes:
        with_parts: whether the beams that the parts block are known.
        blocked: share of all beams that the parts block; null if unknown.
        own: view of the scanner.
        mounts: gains over the reference mounts, the smallest first.
    """

    with_parts: bool
    blocked: float | None
    own: Seen
    mounts: list[SeenGain]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated:
    """View of given mounting angles.

    Attributes:
        task: name of the task.
        angles_deg: alpha_rot, beta_rot, alpha_laser, beta_laser.
        with_parts: whether the figures exclude beams blocked by the parts; always false, see `as_built`.
        J: objective; lower is better; null if it is infinite.
        J_error: bound of its numerical error.
        J_lower: lower bound of J, from the mean count.
        J_agrees_with_J_ball: whether J agrees with the brute-force count; if not, the exit code is 1.
        holes: blind spots.
        J_ball: J by a brute-force count of simulated beams.
        J_ball_error: its error.
        blind_fraction: share of the unmasked sphere that is never seen.
        blind_weight_fraction: share of the weight that is never seen.
        masked_fraction: share of the sphere that is masked.
        min_density: lowest number of beams within the ball radius in the region, at any start phase.
        blind_cones: cones about the axis that no beam enters, the wider one first.
        line_gap_deg: widest distance between neighbouring scan lines.
        seen_twice: share of the weight with double coverage.
        crossing_deg: mean angle at which lines cross there; null if there is no double coverage.
        half_turn_misses: share that half a turn misses of what a full turn sees; null for a sweep.
        J_rises_1_deg_off: angle -> rise of J if it is 1 deg off.
        expected_error: error of a point to expect at 3 m.
        expected_error_far: the same at 5 m; null if the lidar does not reach it.
        wide_gap: warning of a gap much wider than the spacing of lines; null if there is none.
        missed_object: warning that an object as wide as a ball of the task can get no beam; null if none can.
        planes: points on ground, walls and ceilings of the task.
        hidden_regions: regions that the robot hides in part.
        lever: offset of the optical centre that the figures are for; null if it is on the axis.
        empty_cap: largest cone without a beam, of a sweep.
        interlaced_period_s: period for which the lines of the next turn fall between those of this one.
        pole: probability of hitting a pole (`--pole`).
        lowest_points_per_m2: lowest density on the scene mesh of the task.
        median_points_per_m2: median density on it, by area.
        as_built: view with the parts, of a build folder.
    """

    task: str
    angles_deg: list[float]
    with_parts: bool
    J: float | None
    J_error: float | None
    J_lower: float | None
    J_agrees_with_J_ball: bool
    holes: list[BlindSpot]
    J_ball: float | None
    J_ball_error: float | None
    blind_fraction: float
    blind_weight_fraction: float
    masked_fraction: float
    min_density: int
    blind_cones: tuple[BlindCone, ...]
    line_gap_deg: float
    seen_twice: float
    crossing_deg: float | None
    half_turn_misses: float | None
    J_rises_1_deg_off: dict[str, float]
    expected_error: ExpectedError
    expected_error_far: ExpectedError | None
    wide_gap: Finding | None
    missed_object: Finding | None
    planes: list[PlaneFigures]
    hidden_regions: list[Finding]
    lever: Lever | None = None
    empty_cap: BlindCone | None = None
    interlaced_period_s: float | None = None
    pole: PoleChances | None = None
    lowest_points_per_m2: float | None = None
    median_points_per_m2: float | None = None
    as_built: WithParts | None = None


@dataclass(frozen=True, slots=True)
class Compared:
    """The optimum of a task compared with other mounts and scanners.

    Attributes:
        task: name of the task.
        rows: rows of the table.
        gains: gains over the reference mounts, the smallest first.
    """

    task: str
    rows: list[ComparisonRow]
    gains: list[GainResult]

"""Records of the `--json` output of `optimise`, `evaluate` and `compare`."""

from __future__ import annotations

from dataclasses import dataclass

from scanwright.design.evaluation.as_built import Seen
from scanwright.design.evaluation.comparison import ComparisonRow
from scanwright.design.evaluation.evaluation import Lever
from scanwright.design.evaluation.expected_cloud import ExpectedCloud
from scanwright.design.evaluation.gaps import BlindCone
from scanwright.design.evaluation.poles import PoleChances
from scanwright.design.left_out import LeftOut
from scanwright.design.objective.holes import BlindSpot


@dataclass(frozen=True, slots=True)
class ObjectiveResult:
    """The objective of a mount: lower is better."""

    J: float | None  # value
    J_error: float | None  # bound of its numerical error


@dataclass(frozen=True, slots=True)
class MountResult:
    """Mounting angles."""

    alpha_rot_deg: float  # rotation axis, about x
    beta_rot_deg: float  # rotation axis, about y
    alpha_laser_deg: float  # lidar on the axis, about x
    beta_laser_deg: float  # lidar on the axis, about y
    J: float  # objective; lower is better
    J_error: float  # bound of its numerical error


@dataclass(frozen=True, slots=True)
class RankedMount(MountResult):
    """One of the best mounts."""

    settings: int  # number of equivalent mounts
    note: str  # remark of the table, such as two axis directions; empty if there is none


@dataclass(frozen=True, slots=True)
class Unconstrained(MountResult):
    """The mount with the lowest J if blind spots were allowed."""

    holes: list[BlindSpot]  # its blind spots


@dataclass(frozen=True, slots=True)
class Preferred:
    """The price of a simple mount (`prefer = "simple"`)."""

    accepted_loss: float  # share of the beams that the task accepts to lose
    J_more: float  # J of the chosen mount minus the lowest J
    # the mount with the lowest J
    lowest_J: MountResult  # noqa: N815  a key of the JSON object


@dataclass(frozen=True, slots=True)
class GainResult:
    """Gain over a reference mount without parts."""

    name: str  # name of the reference mount
    angles_deg: list[float]  # its alpha_rot, beta_rot, alpha_laser, beta_laser
    # beams per direction of the optimum over those of the mount (geometric mean); null if J is no logarithm
    factor: float | None
    J_less: float | None  # J of the mount minus J of the optimum
    J: float | None  # objective of the mount
    J_error: float | None  # bound of its numerical error
    least: int  # lowest number of beams within the ball radius in the region
    blind_weight: float  # share of the weight that the mount never sees
    keeps_limits: bool  # whether it keeps the limits of the task
    in_ranges: bool  # whether the task allows its angles


@dataclass(frozen=True, slots=True)
class SeenGain(GainResult):
    """Gain over a reference mount, and the view of that mount."""

    seen: Seen  # view of the mount


@dataclass(frozen=True, slots=True)
class Optimised(ExpectedCloud):
    """The best mounting angles of a task."""

    task: str  # name of the task
    with_parts: bool  # whether beams blocked by the parts are excluded; always false here
    duration_s: float  # time of one full scan
    best: list[RankedMount]  # best distinct mounts, best first
    holes: list[BlindSpot]  # blind spots of the best mount
    plain: Unconstrained | None  # the mount with the lowest J if blind spots were allowed; null if it is the best one
    # smallest blind share of the weight of any mount; null if the best mount has no blind spot
    least_blind_weight: float | None
    preferred: Preferred | None  # price of a simple mount; null if none was preferred
    standard: dict[str, ObjectiveResult]  # the reference mounts, name -> objective
    gains: list[GainResult]  # gains over the reference mounts, the smallest first
    covered: int  # number of mounts that the search covers
    evaluated: int  # number of values of J that it computed
    seconds: float  # run time of the search
    left_out: list[LeftOut]  # skipped work, with the reason
    warnings: list[str]  # limits of the task that can surprise


@dataclass(frozen=True, slots=True)
class WithParts:
    """View of a built scanner."""

    with_parts: bool  # whether the beams that the parts block are known
    blocked: float | None  # share of all beams that the parts block; null if unknown
    own: Seen  # view of the scanner
    mounts: list[SeenGain]  # gains over the reference mounts, the smallest first


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated(ExpectedCloud):
    """View of given mounting angles."""

    task: str  # name of the task
    angles_deg: list[float]  # alpha_rot, beta_rot, alpha_laser, beta_laser
    with_parts: bool  # whether the figures exclude beams blocked by the parts; always false, see `as_built`
    J: float | None  # objective; lower is better; null if it is infinite
    J_error: float | None  # bound of its numerical error
    J_lower: float | None  # lower bound of J, from the mean count
    J_agrees_with_J_ball: bool  # whether J agrees with the brute-force count; if not, the exit code is 1
    holes: list[BlindSpot]  # blind spots
    J_ball: float | None  # J by a brute-force count of simulated beams
    J_ball_error: float | None  # its error
    blind_fraction: float  # share of the unmasked sphere that is never seen
    blind_weight_fraction: float  # share of the weight that is never seen
    masked_fraction: float  # share of the sphere that is masked
    min_density: int  # lowest number of beams within the ball radius in the region, at any start phase
    blind_cones: tuple[BlindCone, ...]  # cones about the axis that no beam enters, the wider one first
    line_gap_deg: float  # widest distance between neighbouring scan lines
    seen_twice: float  # share of the weight with double coverage
    crossing_deg: float | None  # mean angle at which lines cross there; null if there is no double coverage
    half_turn_misses: float | None  # share that half a turn misses of what a full turn sees; null for a sweep
    J_rises_1_deg_off: dict[str, float]  # angle -> rise of J if it is 1 deg off
    lever: Lever | None = None  # offset of the optical centre that the figures are for; null if it is on the axis
    empty_cap: BlindCone | None = None  # largest cone without a beam, of a sweep
    # period for which the lines of the next turn fall between those of this one
    interlaced_period_s: float | None = None
    pole: PoleChances | None = None  # probability of hitting a pole (`--pole`)
    lowest_points_per_m2: float | None = None  # lowest density on the scene mesh of the task
    median_points_per_m2: float | None = None  # median density on it, by area
    as_built: WithParts | None = None  # view with the parts, of a build folder


@dataclass(frozen=True, slots=True)
class Compared:
    """The optimum of a task compared with other mounts and scanners."""

    task: str  # name of the task
    rows: list[ComparisonRow]  # rows of the table
    gains: list[GainResult]  # gains over the reference mounts, the smallest first

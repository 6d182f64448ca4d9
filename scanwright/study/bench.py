"""One candidate with its parts: its best mount that can be built, and the columns of its row."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from scanwright.cad.assembly.shadow import PartsWorkshop, at_setting
from scanwright.cad.kernel import require_kernel
from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError, TaskError
from scanwright.design.evaluation.as_built import seen_of
from scanwright.design.evaluation.comparison import per_ball, price_usd
from scanwright.design.objective.named_objectives import beams_per_ball
from scanwright.design.objective.problem import Problem, problem_of
from scanwright.design.objective.score import Score
from scanwright.design.objective.self_check import require_counted
from scanwright.design.progress import no_progress
from scanwright.design.scanner import Scanner
from scanwright.design.search.families import Family
from scanwright.design.search.optimum import angle_set
from scanwright.design.search.shortest_period import shortest_period_s
from scanwright.design.search.with_parts import Refused, choose_with_parts
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.task.task import LoadedTask
from scanwright.study.candidate import density_gain, of_lidar, why, with_motion
from scanwright.study.front import six_digits
from scanwright.study.results import Result

if TYPE_CHECKING:
    from scanwright.cad.assembly.assembly import Assembly
    from scanwright.design.findings import Finding

LOADS = ("static_torque", "spin_up_torque", "tilt_moment", "axial_load", "bearing_load")
BENDS = "deflection"  # of linkage and shaft, by finite elements


@dataclass(frozen=True, slots=True)
class BuiltSetting:
    """Figures of the parts of a mount."""

    shadow: SelfOcclusion  # the beams that they block
    values: dict[str, float | None]  # columns that depend on them
    weakest: str  # the load nearest to its rating


@dataclass(frozen=True, slots=True)
class PartsBench:
    """A `Workshop` of one set of products that makes the parts of each mount once, and rejects failed checks."""

    scanner: Scanner
    _made: dict[tuple[float, ...], BuiltSetting | Refused] = field(default_factory=dict)

    def bound(self, setting_rad: Array) -> SelfOcclusion | Refused:
        """See `Workshop`."""
        return PartsWorkshop(self.scanner).bound(setting_rad)

    def shadow(self, setting_rad: Array) -> SelfOcclusion | Refused:
        """See `Workshop`; also rejects a mount whose clearance, loads, walls or beams fail."""
        made = self.made(setting_rad)
        return made if isinstance(made, Refused) else made.shadow

    def made(self, setting_rad: Array) -> BuiltSetting | Refused:
        """Return the parts of a mount, or why it cannot be built."""
        key = tuple(round(math.degrees(angle), 2) for angle in setting_rad)
        if key not in self._made:
            self._made[key] = _made(at_setting(self.scanner, setting_rad))
        return self._made[key]


def judge_candidate(loaded: LoadedTask, searched: Result) -> Result:
    """Return the best mount of a candidate that can be built, with its columns; `searched` is its `search_candidate`.

    Raises:
        InstallError: the CAD kernel is not installed.
    """
    require_kernel("study")
    families = tuple(_family(entry) for entry in searched["families"])
    loaded = with_motion(loaded, searched)
    try:
        problem = problem_of(loaded)
        bench = PartsBench(loaded.scanner(angle_set(loaded, families[0])))
        chosen = choose_with_parts(problem, families, loaded.task.angles, loaded.task.limits, bench, no_progress)
    except (TaskError, BuildError) as error:
        return {"status": "refused", "reason": why(error, loaded)}
    setting, score = chosen.family.angles_rad, chosen.family.score
    require_counted(loaded, setting, score, chosen.shadow)
    made = bench.made(setting)  # known by now
    assert not isinstance(made, Refused)
    seen = seen_of(problem, setting, score, made.shadow)
    values = {
        "J": score.J,
        "density_gain": density_gain(problem, searched["reference_J"], score.J),
        **of_lidar(loaded.lidar),
        **per_ball(beams_per_ball(problem.objective, score.J), made.values["cost_usd"]),
        "blind_fraction": seen.blind_fraction,
        "line_gap_deg": seen.line_gap_deg,
        "period_s": loaded.task.motion.duration_s,
        "shortest_period_s": _shortest(problem, loaded, chosen.family),
        "hidden_fraction": made.shadow.share(),
        **made.values,
    }
    return {
        "status": "built",
        "angles_deg": list(chosen.family.angles_deg),
        "J_error": six_digits(score.J_error),
        "values": {name: six_digits(value) for name, value in values.items()},
        "weakest": made.weakest,
        "settings_built": chosen.built,
        "settings_refused": list(chosen.refused),
        "families_open": chosen.open,
    }


def _family(entry: dict[str, Any]) -> Family:
    return Family(
        angles_deg=tuple(entry["angles_deg"]),
        score=Score(**entry["score"]),
        members=entry["members"],
        word=entry["word"],
    )


def _shortest(problem: Problem, loaded: LoadedTask, family: Family) -> float | None:
    """Return the column `shortest_period_s`; None if even the period of the row is too short."""
    least = int(np.ceil(loaded.task.limits.min_density or 1))
    if loaded.task.motion.mode != "spin" or family.score.least < least:
        return None
    try:
        return shortest_period_s(problem, family.angles_rad, loaded.lidar.scan_rate_hz, least)
    except TaskError:
        return None


def _made(scanner: Scanner) -> BuiltSetting | Refused:
    from scanwright.cad.assembly.make import make_parts
    from scanwright.cad.checks.run import run_checks

    try:
        assembly = make_parts(scanner)
        checks, shadow = run_checks(assembly, no_progress)
    except BuildError as error:
        return Refused(str(error))
    failed = [check.message for check in checks if check.severity == "error"]
    return Refused(failed[0]) if failed else _weighed(scanner, assembly, checks, shadow)


def _weighed(scanner: Scanner, assembly: Assembly, checks: Sequence[Finding], shadow: SelfOcclusion) -> BuiltSetting:
    from scanwright.cad.assembly.assembly import link_bodies

    margins = {
        check.code: check.limit / check.value
        for check in checks
        if check.code in LOADS and check.limit is not None and check.value
    }
    weakest = min(margins, key=lambda kind: margins[kind], default="")
    ring = () if scanner.slip_ring is None else (scanner.slip_ring,)
    values = {
        "mass_g": 1000 * sum(body.mass_kg for body in link_bodies(assembly).values()),
        "load_margin": margins.get(weakest),
        "deflection_deg": next((check.value for check in checks if check.code == BENDS), None),
        "cost_usd": price_usd([scanner.lidar, scanner.servo, *ring, *assembly.layout.drive.products]),
    }
    return BuiltSetting(shadow, values, weakest)

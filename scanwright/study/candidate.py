"""The two pieces of work of a study, pure functions of a task record: search its angles, judge it with its parts.

What a search finds does not depend on servo, slip ring and printer, so candidates that differ in these share one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from math import exp
from typing import Any, Protocol

import numpy as np

from design.catalogue.catalogue import Catalogue
from design.catalogue.products import SlipRing
from design.errors import ScanwrightError, TaskError
from design.evaluation.coverage import coverage
from design.evaluation.gaps import gaps
from design.frames import Array
from design.objective.problem import Problem, problem_of
from design.objective.score import Score
from design.scanner import Scanner, scanner_of
from design.search.families import Family
from design.search.optimum import Optimum, angle_set, optimum_of
from design.search.shortest_period import shortest_period_s
from design.search.with_parts import Refused, Workshop, choose
from design.task.task import LoadedTask, Task
from scanwright.study.answer.columns import tidy
from scanwright.study.runner.store import Result

ANYBODY = "candidate"  # the name of a task changes nothing
BOUNDED = ("log", "required", "worst")  # objectives that fewer beams can only make worse


@dataclass(frozen=True, slots=True)
class PartFacts:
    """What the parts of a setting decide; see `COLUMNS`. `weakest` names the load nearest to its rating."""

    mass_g: float
    load_margin: float | None
    weakest: str
    deflection_deg: float | None
    cost_usd: float | None


class Bench(Workshop, Protocol):
    """A workshop that refuses settings whose checks fail, and knows the facts of those it has made."""

    def facts(self, setting_rad: Array) -> PartFacts:
        """Of a setting whose `shadow` was asked for."""
        ...


def search_record(loaded: LoadedTask) -> LoadedTask:
    """The part of a candidate's record that its search depends on."""
    task = loaded.task
    limits = task.limits.model_copy(update={"max_blocked": None})
    nobody = {"name": ANYBODY, "servo": "", "slip_ring": None, "printer": "", "limits": limits}
    products = Catalogue({task.sensor: loaded.products.products[task.sensor]})
    return replace(loaded, task=task.model_copy(update=nobody), products=products)


def digest(loaded: LoadedTask) -> str:
    """Of a record: all that decides its result, bearings and belts included, and the name not."""
    nameless = replace(loaded, task=loaded.task.model_copy(update={"name": ANYBODY}))
    choice = (*loaded.products.bearings(), *loaded.products.belts())
    chosen_from = "\n".join(product.model_dump_json() for product in choice)
    return hashlib.sha256(f"{nameless.sha256()}\n{chosen_from}".encode()).hexdigest()


def search_of(loaded: LoadedTask) -> Result:
    """Families of settings of a search record, its period, and what no setting with parts can be better than."""
    try:
        optimum = optimum_of(loaded, _quiet)
    except TaskError as error:
        return {"status": "refused", "reason": _bare(error, loaded)}
    families = optimum.search.best
    problem = optimum.problem
    return {
        "status": "found",
        "motion": optimum.loaded.task.motion.model_dump(mode="json"),
        "standard_J": min(score.J for score in optimum.standard.values()),
        "families": [asdict(family) for family in families],
        "bounds": _bounds(optimum, problem),
    }


def bounds_of(loaded: LoadedTask, found: Result) -> dict[str, float | None]:
    """What no setting of a candidate can be better than, before anything is made."""
    price = _prices(loaded)
    ring = _ring(loaded)
    bought = [loaded.lidar.mass_g, loaded.servo.mass_g] + ([ring.mass_g] if ring else [])
    known: dict[str, float | None] = {"mass_g": sum(bought), "cost_usd": price}
    unbounded: dict[str, float | None] = {"load_margin": np.inf, "hidden_fraction": 0.0, "deflection_deg": 0.0}
    return {name: tidy(value) for name, value in {**unbounded, **found["bounds"], **known}.items()}


def judged(loaded: LoadedTask, found: Result, bench_of: Callable[[Scanner], Bench]) -> Result:
    """The best setting of a candidate that can be built, and everything that decides.

    Args:
        loaded: the candidate's task.
        found: `search_of` of its search record.
        bench_of: makes the parts of a scanner.
    """
    families = tuple(_family(entry) for entry in found["families"])
    loaded = with_motion(loaded, found)
    try:
        problem = problem_of(loaded)
        scanner = scanner_of(angle_set(loaded, families[0]), loaded.task.printer, loaded.products, loaded.task.deck)
        bench = bench_of(scanner)
        chosen = choose(problem, families, loaded.task.angles, loaded.task.limits, bench, _quiet)
    except ScanwrightError as error:
        return {"status": "refused", "reason": _bare(error, loaded)}
    setting = chosen.family.angles_rad
    shadow = bench.shadow(setting)  # known by now
    assert not isinstance(shadow, Refused)
    facts = bench.facts(setting)
    seen = problem.with_beams(problem.bearings_rad[~shadow.beams], problem.lines, problem.sweep)
    J = chosen.family.score.J
    values = {
        "J": J,
        "density_gain": _gain(problem, found["standard_J"], J),
        "blind_fraction": coverage(seen, setting).blind_fraction,
        "line_gap_deg": gaps(problem, setting).line_gap_deg,
        "period_s": loaded.task.motion.duration_s,
        "shortest_period_s": _shortest(problem, loaded, chosen.family),
        "hidden_fraction": chosen.hidden,
        "mass_g": facts.mass_g,
        "load_margin": facts.load_margin,
        "deflection_deg": facts.deflection_deg,
        "cost_usd": facts.cost_usd,
    }
    return {
        "status": "built",
        "angles_deg": list(chosen.family.angles_deg),
        "J_error": tidy(chosen.family.score.J_error),
        "values": {name: tidy(value) for name, value in values.items()},
        "weakest": facts.weakest,
        "settings_built": chosen.built,
        "settings_refused": list(chosen.refused),
        "families_open": chosen.open,
    }


def with_motion(loaded: LoadedTask, found: Result) -> LoadedTask:
    """The candidate with the motion that its search has found."""
    table = loaded.task.model_dump(exclude_none=True) | {"motion": found["motion"]}
    return replace(loaded, task=Task.model_validate(table))


def winner_task(loaded: LoadedTask, found: Result, built: Result) -> LoadedTask:
    """The task that builds just the setting that a candidate won with."""
    moving = with_motion(loaded, found)
    names = ("alpha_rot_deg", "beta_rot_deg", "alpha_laser_deg", "beta_laser_deg")
    fixed = dict(zip(names, built["angles_deg"], strict=True))
    angles = moving.task.angles.model_copy(update=fixed)
    return replace(moving, task=moving.task.model_copy(update={"angles": angles}))


def _bounds(optimum: Optimum, problem: Problem) -> dict[str, float | None]:
    """Over all families: hiding beams lets no column get better than the best of them, but within its error."""
    families = optimum.search.best
    sure = problem.objective.name in BOUNDED
    J = min(f.score.J for f in families) if sure else -np.inf
    period = optimum.loaded.task.motion.duration_s
    gain = _gain(problem, min(score.J for score in optimum.standard.values()), J)
    return {
        "J": J,
        "density_gain": gain,
        "blind_fraction": min(coverage(problem, f.angles_rad).blind_fraction for f in families),
        "line_gap_deg": min(gaps(problem, f.angles_rad).line_gap_deg for f in families),
        "period_s": period,
        "shortest_period_s": 0.0 if problem.sweep is None else None,
    }


def _gain(problem: Problem, standard_J: float, J: float) -> float | None:
    """Times the beams per ball of the better standard alignment: differences of the logarithm are ratios."""
    return exp(standard_J - J) if problem.objective.name == "log" else None


def _shortest(problem: Problem, loaded: LoadedTask, family: Family) -> float | None:
    """See `COLUMNS`; None where not even the row's own period brings so many."""
    least = int(np.ceil(loaded.task.limits.min_density or 1))
    if loaded.task.motion.mode != "spin" or family.score.least < least:
        return None
    try:
        return shortest_period_s(problem, family.angles_rad, loaded.lidar.scan_rate_hz, least)
    except TaskError:
        return None


def _prices(loaded: LoadedTask) -> float | None:
    ring = _ring(loaded)
    prices = [loaded.lidar.price_usd, loaded.servo.price_usd] + ([ring.price_usd] if ring else [])
    known = [price for price in prices if price is not None]
    return sum(known) if len(known) == len(prices) else None


def _ring(loaded: LoadedTask) -> SlipRing | None:
    name = loaded.task.slip_ring
    return None if name is None or loaded.task.motion.mode == "sweep" else loaded.products.get(name, SlipRing)


def _family(entry: dict[str, Any]) -> Family:
    grid = entry["grid_deg"]
    return Family(
        angles_deg=tuple(entry["angles_deg"]),
        score=Score(**entry["score"]),
        members=entry["members"],
        word=entry["word"],
        grid_deg=None if grid is None else tuple(grid),
    )


def _bare(error: ScanwrightError, loaded: LoadedTask) -> str:
    return str(error).removeprefix(f"{loaded.source}: ")


def _quiet(_: str) -> None:
    pass

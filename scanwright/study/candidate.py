"""One candidate before its parts: its record, the search of its angles, and bounds of its columns.

A search does not depend on servo, slip ring and printer, so candidates that differ only in these share one.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, replace
from math import exp

import numpy as np

from scanwright.design.catalogue.catalogue import Catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.product_base import Product
from scanwright.design.errors import ScanwrightError, TaskError
from scanwright.design.evaluation.comparison import bought, per_ball, price_usd
from scanwright.design.evaluation.coverage import coverage
from scanwright.design.evaluation.gaps import gaps
from scanwright.design.objective.named_objectives import beams_per_ball
from scanwright.design.objective.problem import Problem
from scanwright.design.progress import no_progress
from scanwright.design.search.optimum import Optimum, find_optimum
from scanwright.design.task.task import LoadedTask, Task
from scanwright.study.front import six_digits
from scanwright.study.results import Result, address

ANYBODY = "candidate"  # replaces the name of a task, which has no effect on results
BOUNDED = ("log", "required", "worst")  # objectives that never improve with fewer beams
PARTS_DECIDE = {"load_margin": np.inf, "hidden_fraction": 0.0, "deflection_deg": 0.0}


def search_record(loaded: LoadedTask) -> LoadedTask:
    """Return the part of a candidate's record that its search depends on."""
    task = loaded.task
    limits = task.limits.model_copy(update={"max_blocked": None})
    anonymous = {"name": ANYBODY, "servo": "", "slip_ring": None, "printer": "", "limits": limits}
    products = Catalogue({task.sensor: loaded.products.products[task.sensor]})
    return replace(loaded, task=task.model_copy(update=anonymous), products=products)


def record_digest(loaded: LoadedTask) -> str:
    """Return the digest of everything that affects the result of a record, including bearings and belts."""
    nameless = replace(loaded, task=loaded.task.model_copy(update={"name": ANYBODY}))
    choice: tuple[Product, ...] = (*loaded.products.bearings(), *loaded.products.belts())
    chosen_from = "\n".join(product.model_dump_json() for product in choice)
    return hashlib.sha256(f"{nameless.sha256()}\n{chosen_from}".encode()).hexdigest()


def addresses(loaded: LoadedTask) -> tuple[str, str]:
    """Return the addresses of the search and of the result of a candidate."""
    return address("search", record_digest(search_record(loaded))), address("candidate", record_digest(loaded))


def search_candidate(loaded: LoadedTask) -> Result:
    """Search a record: groups of mounts, period, and bounds for mounts with parts."""
    try:
        optimum = find_optimum(loaded, no_progress)
    except TaskError as error:
        return {"status": "refused", "reason": why(error, loaded)}
    reference_J = min(mount.score.J for mount in optimum.mounts)
    return {
        "status": "found",
        "motion": optimum.loaded.task.motion.model_dump(mode="json"),
        "reference_J": reference_J,
        "families": [asdict(family) for family in optimum.search.best],
        "bounds": _bounds(optimum, reference_J),
    }


def _bounds(optimum: Optimum, reference_J: float) -> dict[str, float | None]:
    """Return bounds over all groups: blocked beams improve no column beyond the best of them."""
    families, problem = optimum.search.best, optimum.problem
    J = min(f.score.J for f in families) if problem.objective.name in BOUNDED else -np.inf
    return {
        "J": J,
        "density_gain": density_gain(problem, reference_J, J),
        "beams_per_ball": beams_per_ball(problem.objective, J),
        "blind_fraction": min(coverage(problem, f.angles_rad).blind_fraction for f in families),
        "line_gap_deg": min(gaps(problem, f.angles_rad).line_gap_deg for f in families),
        "period_s": optimum.loaded.task.motion.duration_s,
        "shortest_period_s": 0.0 if problem.sweep is None else None,
    }


def bounds_of(loaded: LoadedTask, searched: Result) -> dict[str, float | None]:
    """Return the bounds of a candidate's columns before its parts are made."""
    products = bought(loaded)
    known = {
        "mass_g": sum(product.mass_g for product in products),
        **of_lidar(loaded.lidar),
        **per_ball(searched["bounds"]["beams_per_ball"], price_usd(products)),
    }
    return {name: six_digits(value) for name, value in {**PARTS_DECIDE, **searched["bounds"], **known}.items()}


def of_lidar(lidar: Lidar) -> dict[str, float | None]:
    """Return the columns that depend on the lidar alone."""
    return {"range_m": lidar.stated_range_m, "range_sigma_mm": lidar.range_sigma_mm}


def density_gain(problem: Problem, reference_J: float, J: float) -> float | None:
    """Return the ratio of beams per ball to the best reference mount, from the difference of logarithms."""
    return exp(reference_J - J) if problem.objective.name == "log" else None


def with_motion(loaded: LoadedTask, searched: Result) -> LoadedTask:
    """Return the candidate with the motion that its search chose."""
    table = loaded.task.model_dump(exclude_none=True) | {"motion": searched["motion"]}
    return replace(loaded, task=Task.model_validate(table))


def winner_task(loaded: LoadedTask, searched: Result, built: Result) -> LoadedTask:
    """Return the task that builds the mount of a winner."""
    moving = with_motion(loaded, searched)
    names = ("alpha_rot_deg", "beta_rot_deg", "alpha_laser_deg", "beta_laser_deg")
    fixed = dict(zip(names, built["angles_deg"], strict=True))
    angles = moving.task.angles.model_copy(update=fixed)
    return replace(moving, task=moving.task.model_copy(update={"angles": angles}))


def why(error: ScanwrightError, loaded: LoadedTask) -> str:
    """Return the message of an error without the file of the task."""
    return str(error).removeprefix(f"{loaded.source}: ")

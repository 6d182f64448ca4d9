"""Objectives of the search. Each is one function `(field, loaded) -> Objective` below, with its formula.

`design.task.objective_names` lists them; installed packages add theirs by entry points. An objective combines a few
moments of the density: `J = join(m_1, m_2, ..)`. A moment is the mean of g(d) over a weight and over the start phase of
the turn, or the highest g(d). Every g is convex, and no join falls if a moment of a nonlinear g rises, so J of the mean
counts is a lower bound of J, which the search uses. If regions require different densities (`required`), each level is
one moment. When to use which: `docs/definitions.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from scanwright.design.arrays import Array, Counts
from scanwright.design.errors import TaskError
from scanwright.design.sphere.directions import equal_angle_grid
from scanwright.design.sphere.painting import MAP, VALUE
from scanwright.design.sphere.regions import Field, field_of
from scanwright.design.sphere.total_weight import RELATIVE_ERROR, total_weight
from scanwright.design.task.objective_names import objectives
from scanwright.design.task.shapes import Region
from scanwright.design.task.task import LoadedTask


@dataclass(frozen=True, slots=True)
class Moment:
    """A mean or an extreme value of a function of the count over a weight.

    Attributes:
        field: the weights, masks included.
        g: convex function of the count.
        gathered: whether it is the mean of g, or the highest g at any start phase.
        share: share of the weight of the task that this moment represents; 0 if another moment represents it.
    """

    field: Field
    g: Callable[[Counts], Array]
    gathered: Literal["mean", "highest"] = "mean"
    share: float = 1.0


@dataclass(frozen=True, slots=True)
class Objective:
    """An objective.

    Attributes:
        name: of the objective.
        field: the weight of the task.
        moments: that J is computed from.
        join: maps moments, shape (moments, ...), to J, shape (...).
        join_error: bound of the error of `join`.
    """

    name: str
    field: Field
    moments: tuple[Moment, ...]
    join: Callable[[Array], Array]
    join_error: float = 0.0


def log_density(counts: Counts) -> Array:
    """Return `g(d) = -ln(1 + d)`, the logarithm of the paper with its sign: the first beams count most."""
    return -np.log1p(counts)


def objective_of(loaded: LoadedTask, field: Field) -> Objective:
    """Return the objective of a task over its weights.

    Raises:
        TaskError: the objective cannot be loaded, or is `required` and a region states no density.
    """
    entry = objectives(loaded.task.density.objective)[loaded.task.density.objective]
    try:
        make: Callable[[Field, LoadedTask], Objective] = entry.load()
    except Exception as error:  # importing a package can raise anything
        where = f"{loaded.source}: density.objective = '{entry.name}'"
        raise TaskError(f"{where}: cannot load {entry.value} of an installed package: {error}") from error
    return make(field, loaded)


def log(field: Field, _loaded: LoadedTask | None = None) -> Objective:
    """`J = mean_w <-ln(1 + d)>`: `exp(J_other - J)` is the ratio of the beams per ball in the geometric mean."""
    return Objective("log", field, (Moment(field, log_density),), _first)


def beams_per_ball(objective: Objective, J: float) -> float | None:
    """Return `exp(-J) - 1`, the beams per ball by the geometric mean of 1 + d; None for objectives other than `log`."""
    return float(np.expm1(-J)) + 0.0 if objective.name == "log" else None


def kl(field: Field, loaded: LoadedTask) -> Objective:
    """Kullback-Leibler divergence [nat] of the density from the weights: 0 if 1 + d is proportional to the weight.

    `J = int p ln(p / q) dO` over the directions with a weight, p = w / int w, q = (1 + d) / int (1 + d). It does not
    depend on the number of beams. Logarithm and normaliser are averaged over the start phase separately.
    """
    grid_step_deg = _grid_step_deg(loaded)
    support = _mapped(field, lambda w: (w > 0).astype(float))
    least = _least(field)  # as the unit of weights it keeps all logarithms positive
    logarithms = _mapped(field, lambda w: w * (np.log(np.where(w > 0, w, least)) - np.log(least)))
    logs, full, solid_angle = (_summed(one, grid_step_deg) for one in (logarithms, field, support))
    shift = logs / full + np.log(least) - np.log(full / solid_angle)
    moments = (Moment(field, log_density), Moment(support, _one_more, share=0.0))
    error = 0.0 if grid_step_deg else RELATIVE_ERROR * (2 * abs(logs / full) + 2)
    return Objective("kl", field, moments, lambda m: m[0] + np.log(m[1]) + shift, error)


def required(field: Field, loaded: LoadedTask) -> Objective:
    """Mean shortfall, 0 to 1: `J = mean_w <max(0, 1 - d / r)>` with the density r that each region requires."""
    default, grid_step_deg = loaded.task.density.required, _grid_step_deg(loaded)
    levels = [default if region.required is None else region.required for region in loaded.task.weight]
    levels += [default] if loaded.task.density.background > 0 else []
    missing = [i for i, r in enumerate(levels) if r is None]
    if missing or not levels:
        where = f"weight.{missing[0]}.required" if missing and missing[0] < len(loaded.task.weight) else "required"
        raise TaskError(
            f"{loaded.source}: density.objective = 'required': {where}: set the number of beams per ball, for all "
            "regions (density.required) or in each ([[weight]] required)"
        )
    moments = []
    for level in sorted({r for r in levels if r is not None}):
        part = field_of(loaded, _weight_at_level(level, default), loaded.task.density.background * (default == level))
        if len(part.patches):
            moments.append(Moment(part, _shortfall(level), share=_summed(part, grid_step_deg)))
    total = sum(moment.share for moment in moments)
    shared = tuple(replace(moment, share=moment.share / total) for moment in moments if moment.share > 0)
    if len(shared) == 1:
        shared = (replace(shared[0], field=field),)
    shares = np.array([moment.share for moment in shared])
    error = 0.0 if grid_step_deg or len(shared) == 1 else 2 * RELATIVE_ERROR  # no moment is above 1
    return Objective("required", field, shared, lambda m: np.tensordot(shares, m, axes=1), error)


def homogeneity(field: Field, _loaded: LoadedTask | None = None) -> Objective:
    """Variation of the count in the region: `J = ln(mean_w <d^2> / (mean_w <d>)^2)`, 0 if all counts are equal.

    The second moment is the spherical Ripley function integrated over the overlap of two balls, but with weights,
    masks and the start phase of the turn.
    """
    moments = (Moment(field, np.square), Moment(field, _itself, share=0.0))
    return Objective("homogeneity", field, moments, _dispersion)


def worst(field: Field, _loaded: LoadedTask | None = None) -> Objective:
    """`J = -ln(1 + least)` with the lowest number of beams per ball in the region at any start phase."""
    return Objective("worst", field, (Moment(field, log_density, "highest"),), _first)


def _grid_step_deg(loaded: LoadedTask) -> float | None:
    """Return the step of the paper's grid if the task sums over it, else None."""
    density = loaded.task.density
    return density.grid_step_deg if density.quadrature == "equal_angle" else None


def _summed(field: Field, grid_step_deg: float | None) -> float:
    """Return the total weight of a field: over solid angle, or over the nodes of the paper's grid."""
    return float(field.weight_at(equal_angle_grid(grid_step_deg)).sum()) if grid_step_deg else total_weight(field)


def _first(moments: Array) -> Array:
    return np.asarray(moments[0])


def _itself(counts: Counts) -> Array:
    return np.asarray(counts, dtype=float)


def _one_more(counts: Counts) -> Array:
    return 1.0 + counts


def _weight_at_level(level: float, default: float | None) -> Callable[[Region], float]:
    """Return the function that maps regions to their weight, or to 0 if they require another density than `level`."""
    return lambda region: region.value if (region.required or default) == level else 0.0


def _shortfall(level: float) -> Callable[[Counts], Array]:
    return lambda counts: np.maximum(0.0, 1.0 - counts / level)


def _dispersion(moments: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(moments[1] > 0, np.log(moments[0] / moments[1] ** 2), np.inf)


def _mapped(field: Field, function: Callable[[Array], Array]) -> Field:
    """Return the field with a function applied to every weight."""
    rows, tables = field.weight.rows.copy(), field.weight.tables.copy()
    maps = rows[:, 0] == MAP
    for row in rows[maps]:
        tables[int(row[1])] = function(row[VALUE] * tables[int(row[1])])
    rows[:, VALUE] = np.where(maps, 1.0, function(rows[:, VALUE]))
    weight = replace(field.weight, rows=rows, tables=tables)
    return replace(field, weight=weight, background=float(function(np.array([field.background]))[0]))


def _least(field: Field) -> float:
    """Return the smallest positive weight of any region."""
    rows = field.patches
    painted = [rows[rows[:, 0] != MAP, VALUE]]
    painted += [row[VALUE] * field.weight.tables[int(row[1])].ravel() for row in rows[rows[:, 0] == MAP]]
    values = np.concatenate(painted)
    return float(values[values > 0].min())

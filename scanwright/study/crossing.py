"""All combinations of a study, one task record each, made on demand: there may be millions."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import ValidationError

from scanwright.design.catalogue.catalogue import Catalogue
from scanwright.design.errors import TaskError
from scanwright.design.files.faults import format_validation_error
from scanwright.design.task.named_products import motion_faults
from scanwright.design.task.task import LoadedTask, Task
from scanwright.study.study import NO_RING, LoadedStudy, Mounting

LONGEST_NAME = 64  # of a task
AXES = ("task", "mounting", "sensor", "servo", "slip_ring", "printer", "period")


@dataclass(frozen=True, slots=True)
class Combination:
    """One candidate before any work."""

    number: int  # its index in the study
    name: str  # of the task record, and of its build folder
    group: int  # index of its task: only candidates of one task compete
    choice: dict[str, str]  # the value on each axis; empty for that of the task
    loaded: LoadedTask | None  # the task; None if it is rejected
    refused: str = ""  # why these products cannot do this task


@dataclass(frozen=True, slots=True)
class Crossing:
    """The product of the axes of a study; the last axis changes fastest."""

    loaded: LoadedStudy

    @property
    def axes(self) -> dict[str, tuple[Any, ...]]:
        """Return the values of each axis; (None,) keeps the value of the task."""
        study = self.loaded.study
        lists: tuple[tuple[Any, ...], ...] = (
            self.loaded.tasks,
            study.mounting,
            study.sensors,
            study.servos,
            study.slip_rings,
            study.printers,
            study.periods_s,
        )
        return {axis: values or (None,) for axis, values in zip(AXES, lists, strict=True)}

    def __len__(self) -> int:
        return math.prod(len(values) for values in self.axes.values())

    def __iter__(self) -> Iterator[Combination]:
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> Combination:
        axes = self.axes
        places = np.unravel_index(number, [len(values) for values in axes.values()])
        chosen = {axis: values[int(place)] for (axis, values), place in zip(axes.items(), places, strict=True)}
        words = {axis: _word(value) for axis, value in chosen.items()}
        varied = [words[axis] for axis, values in axes.items() if len(values) > 1 or axis == "task"]
        base: LoadedTask = chosen["task"]
        name = _named(varied)
        task: Task | None = None
        refused = ""
        try:
            task = _merged(base.task, chosen, name, self._own_files())
            products = Catalogue(
                base.products.products | (self.loaded.products.products if self.loaded.study.catalogue else {})
            )
            faults = [str(fault) for fault in motion_faults(task.product_names(), task.motion, products)]
            faults = faults or replace(base, task=task, products=products).unread_angles()
            refused = faults[0] if faults else ""
        except ValidationError as error:
            refused = format_validation_error(error, name, Task).splitlines()[0]
        except TaskError as error:
            refused = str(error)
        loaded = None if refused or task is None else _trimmed(replace(base, task=task, products=products))
        return Combination(number, name, int(places[0]), words, loaded, refused)

    def _own_files(self) -> tuple[str, ...]:
        """Return the absolute paths of the catalogue files of the study."""
        return tuple(str((self.loaded.source.parent / file).resolve()) for file in self.loaded.study.catalogue)


def _merged(task: Task, chosen: dict[str, Any], name: str, catalogue: tuple[str, ...]) -> Task:
    """Return the task with the values of a combination.

    Raises:
        ValidationError: the result is no task.
        TaskError: its motion has no period.
    """
    table = task.model_dump(exclude_none=True) | {"name": name, "catalogue": (*task.catalogue, *catalogue)}
    for axis in ("sensor", "servo", "slip_ring", "printer"):
        if chosen[axis] is not None:
            table[axis] = chosen[axis]
    if table.get("slip_ring") == NO_RING or task.motion.mode == "sweep":  # a sweep needs no ring
        table.pop("slip_ring", None)
    mounting: Mounting | None = chosen["mounting"]
    if mounting is not None:
        table["angles"] = table["angles"] | mounting.angles.model_dump(exclude_unset=True)
        table["limits"] = table["limits"] | mounting.limits.model_dump(exclude_unset=True)
    period = chosen["period"]
    if period is not None:
        table["motion"] = _with_period(table["motion"], period)
    return Task.model_validate(table)


def _with_period(motion: dict[str, Any], period: float | str) -> dict[str, Any]:
    if motion["mode"] == "stop_and_go":
        raise TaskError(f"periods_s: {period}: a motion of mode 'stop_and_go' has no period")
    if motion["mode"] == "sweep":
        if period == "shortest":
            raise TaskError("periods_s: 'shortest' requires motion.mode = 'spin', this task sweeps")
        return motion | {"period_s": period}
    return {"mode": "shortest"} if period == "shortest" else {"mode": "spin", "period_s": period}


def _trimmed(loaded: LoadedTask) -> LoadedTask:
    """Return the task with its own products, bearings and belts only, to be sent to a worker."""
    task = loaded.task
    names = [task.sensor, task.servo, task.slip_ring, task.printer]
    names += [product.name for product in (*loaded.products.bearings(), *loaded.products.belts())]
    return replace(loaded, products=Catalogue({name: loaded.products.products[name] for name in names if name}))


def _word(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, LoadedTask):
        return value.task.name
    if isinstance(value, Mounting):
        return value.name
    return f"{value:g}s" if isinstance(value, float) else str(value)


def _named(words: list[str]) -> str:
    """Return a file name of the words; a digest replaces its end if it is too long."""
    name = re.sub(r"[^A-Za-z0-9_-]+", "-", "-".join(filter(None, words)))
    if len(name) <= LONGEST_NAME:
        return name
    return f"{name[: LONGEST_NAME - 9]}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"

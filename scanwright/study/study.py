"""The study file: tasks and products to combine, and columns to trade off.

Every list multiplies the candidates; without a list each task keeps its own value.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from scanwright.design.catalogue.catalogue import Catalogue, load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.products import Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import TaskError, suggest
from scanwright.design.files.faults import NAME, format_validation_error
from scanwright.design.files.record import Record
from scanwright.design.motion import LONGEST_S, SHORTEST_S
from scanwright.design.task.angle_ranges import AngleRanges
from scanwright.design.task.named_record import named_table
from scanwright.design.task.task import Limits, LoadedTask, load_task
from scanwright.study.front import COLUMNS

SHIPPED = Path(__file__).parent / "shipped"
NO_RING = "none"

Period = Annotated[float, Field(strict=True, ge=SHORTEST_S, le=LONGEST_S)] | Literal["shortest"]


class Mounting(Record):
    """Restriction of the mount: keys of `[angles]` and `[limits]` that replace those of a task."""

    name: str = Field(pattern=NAME)
    angles: AngleRanges = AngleRanges()
    limits: Limits = Limits()


class Study(Record):
    """One study file with every default written out."""

    name: str = Field(pattern=NAME)
    tasks: tuple[str, ...] = Field(min_length=1, description="task files next to the study, or shipped tasks")
    sensors: tuple[str, ...] = ()
    servos: tuple[str, ...] = ()
    slip_rings: tuple[str, ...] = Field(default=(), description="'none' for a scanner that needs none")
    printers: tuple[str, ...] = ()
    periods_s: tuple[Period, ...] = ()
    mounting: tuple[Mounting, ...] = ()
    catalogue: tuple[str, ...] = ()
    front: tuple[str, ...] = Field(min_length=1, description="columns that are traded for each other")
    winners: int = Field(
        default=1, ge=0, description="built of each task: the first of its front, by its columns in their order"
    )
    time_limit_s: float = Field(default=900.0, gt=0, description="limit for one candidate on a worker")

    @field_validator("tasks", "sensors", "servos", "slip_rings", "printers", "periods_s", "front")
    @classmethod
    def _each_once(cls, values: tuple[str | float, ...]) -> tuple[str | float, ...]:
        twice = next((value for i, value in enumerate(values) if value in values[:i]), None)
        if twice is not None:
            raise ValueError(f"{twice!r} is named twice")
        return values

    @field_validator("periods_s", mode="before")
    @classmethod
    def _numbers_or_shortest(cls, periods: Any) -> Any:
        wrong = [p for p in periods if isinstance(p, str) and p != "shortest"] if isinstance(periods, list) else []
        if wrong:
            raise ValueError(f"{wrong[0]!r} is no period: seconds, or 'shortest'")
        return periods

    @field_validator("front")
    @classmethod
    def _columns_exist(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        unknown = next((name for name in names if name not in COLUMNS), None)
        if unknown is not None:
            raise ValueError(f"{unknown!r} is no column{suggest(unknown, COLUMNS)}")
        return names

    @model_validator(mode="after")
    def _mountings_differ(self) -> Study:
        names = [mounting.name for mounting in self.mounting]
        if len(set(names)) < len(names):
            raise ValueError("mounting: two of them have the same name")
        return self


@dataclass(frozen=True, slots=True)
class LoadedStudy:
    """A study, the file it came from, its tasks, and its products."""

    study: Study
    source: Path
    tasks: tuple[LoadedTask, ...]
    products: Catalogue


def load_study(path: Path) -> LoadedStudy:
    """Read a study file, or a shipped study by its name.

    Raises:
        TaskError: the file is missing or malformed, a task cannot be read, or a product is unknown.
    """
    table, source = named_table(path, SHIPPED, "study")
    try:
        study = Study.model_validate(table)
    except ValidationError as error:
        raise TaskError(format_validation_error(error, source, Study)) from error
    products = load_catalogue(*(source.parent / extra for extra in study.catalogue))
    for field, kind in (("sensors", Lidar), ("servos", Servo), ("slip_rings", SlipRing), ("printers", Printer)):
        for name in getattr(study, field):
            if (field, name) == ("slip_rings", NO_RING):
                continue
            try:
                products.get(name, kind)
            except TaskError as error:
                raise TaskError(f"{source}: {field}: {error}") from error
    tasks = tuple(_task(source, name) for name in study.tasks)
    names = [loaded.task.name for loaded in tasks]
    twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
    if twice is not None:
        raise TaskError(f"{source}: tasks: two of them have the name '{twice}': rename one in its file")
    return LoadedStudy(study, source, tasks, products)


def _task(source: Path, name: str) -> LoadedTask:
    in_folder = source.parent / name
    try:
        return load_task(in_folder if in_folder.is_file() or in_folder.suffix == ".toml" else Path(name))
    except TaskError as error:
        raise TaskError(f"{source}: tasks: {error}") from error

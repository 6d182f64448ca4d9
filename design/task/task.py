"""The task file: what the scanner shall see, what it is made of, and which angles may be chosen.

Files speak degrees and millimetres; every key that has a unit ends in it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from design.angles import Angles, AngleSet
from design.arrays import Array
from design.camera import Camera
from design.catalogue.catalogue import Catalogue, load_catalogue
from design.catalogue.products import Lidar, Printer, Servo, SlipRing
from design.deck_holes import DeckHoles
from design.errors import TaskError
from design.motion import Motion, Shortest, Spin, Sweep
from design.record import Record
from design.scanner import Scanner, scanner_of
from design.scene.surface import Surface, cast_surface
from design.task.map_file import read_map
from design.task.named_record import named_record, names_in, valid_record
from design.task.shapes import (
    BoxRegion,
    GridStep,
    MapRegion,
    MaskRegion,
    MeshRegion,
    Number,
    Placed,
    Region,
    Required,
    Span,
    Value,
)

SHIPPED = Path(__file__).parent / "shipped"

Angle = Number | Span
"""One value fixes the angle; two are the range to search, in degrees."""

NAMES = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")


class AngleRanges(Record):
    """Mounting angles to search over, or fixed."""

    alpha_rot_deg: Angle = (-180.0, 180.0)
    beta_rot_deg: Angle = (-90.0, 90.0)
    alpha_laser_deg: Angle = (-90.0, 90.0)
    beta_laser_deg: Angle = (-90.0, 90.0)
    step_deg: Number = Field(default=5.0, ge=0.5, le=45)
    tolerance_deg: Number = Field(default=0.0, ge=0, le=10, description="of the mounting: the optimum bears it best")
    holes: Literal["avoid", "allow"] = Field(
        default="avoid", description="directions of weight that no beam ever comes near; 'allow' is the paper's plain J"
    )

    @model_validator(mode="after")
    def _within_bounds(self) -> AngleRanges:
        for name, bound in (("alpha_rot", 180), ("beta_rot", 90), ("alpha_laser", 90), ("beta_laser", 90)):
            lower, upper = self.limits(name)
            if not -bound <= lower <= upper <= bound:
                raise ValueError(f"{name}_deg = {[lower, upper]} does not rise within -{bound} .. {bound}")
        return self

    def limits(self, name: str) -> Span:
        """Range of one angle in degrees; both ends are equal where it is fixed."""
        angle: Angle = getattr(self, f"{name}_deg")
        return angle if isinstance(angle, tuple) else (angle, angle)

    def grid_deg(self, name: str) -> Array:
        """Settings of one angle that the search visits, both limits included."""
        lower, upper = self.limits(name)
        steps = int(np.floor((upper - lower) / self.step_deg + 1e-9))
        grid = lower + self.step_deg * np.arange(steps + 1)
        return grid if upper - grid[-1] < 1e-9 else np.append(grid, upper)


class DensityRules(Record):
    """How density is counted and judged; see `docs/definitions.md`, Density and Objective."""

    ball_radius_deg: Number = Field(default=2.0, ge=0.01, le=90)
    objective: Literal["log", "kl", "required", "homogeneity", "worst"] = "log"
    required: Required = None
    background: Value = 0.0
    quadrature: Literal["solid_angle", "equal_angle"] = "solid_angle"
    grid_step_deg: GridStep = 1.0
    tolerance: Number | None = Field(default=None, gt=0, description="error of J that is good enough")
    budget_s: Number | None = Field(default=None, gt=0, description="time that one J may take")


class Limits(Record):
    """What every reported setting must keep, whatever its J."""

    min_density: Number | None = Field(default=None, ge=1, description="beams per ball, anywhere in the region")
    max_line_gap_deg: Number | None = Field(default=None, gt=0, le=360, description="between neighbouring scan lines")
    max_blind_cone_deg: Number | None = Field(default=None, ge=0, le=90, description="half angle, about the axis")
    max_blocked: Number | None = Field(default=None, gt=0, le=1, description="share of the beams that parts may hide")
    max_blind_weight: Number | None = Field(default=None, ge=0, le=1, description="share of the weight never seen")


class Task(Record):
    """One task file with every default written out."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")
    sensor: str
    servo: str
    slip_ring: str | None = None
    printer: str = "fdm-0.4"
    catalogue: tuple[str, ...] = ()
    deck: DeckHoles | None = None
    motion: Annotated[Motion | Shortest, Field(discriminator="mode")]
    angles: AngleRanges = AngleRanges()
    density: DensityRules = DensityRules()
    limits: Limits = Limits()
    weight: tuple[Region, ...] = ()
    mask: tuple[MaskRegion, ...] = ()
    scene: Placed | None = None
    camera: Camera | None = None

    @model_validator(mode="after")
    def _boxes_stand_in_a_scene(self) -> Task:
        if self.scene is None and any(isinstance(region, BoxRegion) for region in self.weight):
            raise ValueError("a weight of shape = 'box' needs a [scene] that it stands in")
        return self

    @field_validator("motion", mode="before")
    @classmethod
    def _spins_if_not_told(cls, motion: Any) -> Any:
        if not isinstance(motion, dict):
            return motion
        if motion.get("period_s") == "shortest" and motion.get("mode", "spin") == "spin":
            return {key: value for key, value in motion.items() if key != "period_s"} | {"mode": "shortest"}
        return {"mode": "spin"} | motion

    @field_validator("name", mode="before")
    @classmethod
    def _is_a_folder_name(cls, name: Any) -> Any:
        if isinstance(name, str) and ("/" in name or "\\" in name or ".." in name):
            raise ValueError("a task name becomes a folder name and cannot hold a path: use letters, digits, _ and -")
        return name


@dataclass(frozen=True, slots=True)
class LoadedTask:
    """A task, the file it came from, the products it names, and its maps.

    `maps` holds the tables of the `map` and `mesh` regions, weights first, then masks, in their order; (rows, columns)
    each. `surface` is what the rays into the scene hit.
    """

    task: Task
    source: Path
    products: Catalogue
    maps: tuple[Array, ...]
    surface: Surface | None = None

    def angle_set(self, angles_deg: Sequence[float]) -> AngleSet:
        """Mounting angles with the products of this task, in the order of `NAMES`; the motion is open where it is."""
        task = self.task
        return AngleSet(
            task=task.name,
            angles_deg=Angles(**dict(zip(NAMES, angles_deg, strict=True))),
            sensor=task.sensor,
            servo=task.servo,
            slip_ring=None if isinstance(task.motion, Sweep) else task.slip_ring,
            motion=None if isinstance(task.motion, Shortest) else task.motion,
        )

    def scanner(self, angles: AngleSet) -> Scanner:
        """The scanner of an angle set, with the printer and the deck of this task.

        Raises:
            TaskError: a product of the angle set is not in the catalogue.
        """
        return scanner_of(angles, self.task.printer, self.products, self.task.deck)

    @property
    def lidar(self) -> Lidar:
        """The 2D lidar of the task."""
        return self.products.get(self.task.sensor, Lidar)

    @property
    def servo(self) -> Servo:
        """The servo of the task."""
        return self.products.get(self.task.servo, Servo)

    def warnings(self) -> list[str]:
        """What the task can do, but not as well as its author may think."""
        seen_deg = self.servo.position_feedback_deg
        if seen_deg < 360 and not isinstance(self.task.motion, Sweep):
            return [
                f"{self.servo.name}: position_feedback_deg = {seen_deg:g}: in {360 - seen_deg:g} deg of every turn no "
                "angle is read, and scans there have none; take a servo that reads all around, such as MX-64R"
            ]
        return []

    def sha256(self) -> str:
        """Digest of all that decides the result: the task, its maps, and the records of its products."""
        task = self.task.model_dump(mode="json", exclude={"catalogue", "camera"})  # it only looks on
        for region in [*task["weight"], *task["mask"]]:
            region.pop("file", None)  # what is in it counts, not what it is called
        if task["scene"]:
            task["scene"].pop("file")
        parts = [json.dumps(task, sort_keys=True)]
        names = [self.task.sensor, self.task.servo, self.task.slip_ring, self.task.printer]
        parts += [self.products.products[name].model_dump_json() for name in names if name]
        digest = hashlib.sha256("\n".join(parts).encode())
        for table in self.maps:
            digest.update(np.ascontiguousarray(table).tobytes())
        if self.surface is not None:
            digest.update(self.surface.range_m.tobytes())
        return digest.hexdigest()


def load_task(source: Path | str | Mapping[str, Any]) -> LoadedTask:
    """Read a task file, a shipped task by its name, or a table with the keys of a task file.

    Args:
        source: the file, the name, or the table; files that a table names lie in the working folder.

    Raises:
        TaskError: the file is missing or malformed, a product is unknown, a map cannot be read, or the servo
            cannot do the motion.
    """
    if isinstance(source, Mapping):
        return _load(valid_record(source, Task, Path("task")), Path("task"))
    return _load(*named_record(Path(source), Task, SHIPPED, "task"))


def _load(task: Task, source: Path) -> LoadedTask:
    """With its products and maps."""
    products = load_catalogue(*(source.parent / extra for extra in task.catalogue))
    check_products(task, products, source)
    limits = task.limits
    if isinstance(task.motion, Shortest) and limits.min_density is None and limits.max_line_gap_deg is None:
        raise TaskError(
            f"{source}: motion.period_s = 'shortest': shortest for what? Set limits.min_density or "
            "limits.max_line_gap_deg"
        )
    regions = [*task.weight, *task.mask]
    maps = tuple(_table(region, source.parent) for region in regions if isinstance(region, MapRegion | MeshRegion))
    surface = None if task.scene is None else _surface(task.scene, source.parent)
    return LoadedTask(task=task, source=source, products=products, maps=maps, surface=surface)


def shipped_tasks() -> list[str]:
    """Names of the tasks that come with the package."""
    return names_in(SHIPPED)


def check_products(task: Task, products: Catalogue, source: Path) -> None:
    """Whether the products of a task exist and can do its motion.

    Raises:
        TaskError: they cannot.
    """
    field = "sensor"
    try:
        products.get(task.sensor, Lidar)
        field = "servo"
        products.get(task.servo, Servo)
        field = "printer"
        products.get(task.printer, Printer)
        field = "slip_ring"
        ring = None if task.slip_ring is None else products.get(task.slip_ring, SlipRing)
    except TaskError as error:
        raise TaskError(f"{source}: {field}: {error}") from error
    _check_speed(task, products, source)
    if isinstance(task.motion, Sweep):
        reach = products.get(task.servo, Servo).angular_range_deg / 2
        if max(-task.motion.limits_deg[0], task.motion.limits_deg[1]) > reach:
            raise TaskError(
                f"{source}: motion.limits_deg = {list(task.motion.limits_deg)}: the {task.servo} reaches "
                f"-{reach:g} .. {reach:g}"
            )
        return
    if ring is None:
        word = "turns without end" if isinstance(task.motion, Spin | Shortest) else "goes all around"
        raise TaskError(f"{source}: slip_ring: motion.mode = '{task.motion.mode}' {word} and needs a slip ring")


def fastest_rpm(task: Task, products: Catalogue) -> tuple[float, str]:
    """How fast servo and slip ring of a task turn, and what says so: its field."""
    servo = products.get(task.servo, Servo)
    ring = None if task.slip_ring is None else products.get(task.slip_ring, SlipRing)
    bounds = [(servo.no_load_rpm, f"servo = '{servo.name}'")]
    if ring is not None and ring.max_rpm is not None and not isinstance(task.motion, Sweep):
        bounds.append((ring.max_rpm, f"slip_ring = '{ring.name}'"))
    return min(bounds)


def _check_speed(task: Task, products: Catalogue, source: Path) -> None:
    motion = task.motion
    if not isinstance(motion, Spin | Sweep):
        return
    most, field = fastest_rpm(task, products)
    if isinstance(motion, Spin):
        rpm, least_s = 60 / motion.period_s, 60 / most
    else:
        span_deg, cruise_deg_s = motion.limits_deg[1] - motion.limits_deg[0], 6 * most
        rpm, least_s = motion.cruise_deg_s / 6, 2 * (span_deg / cruise_deg_s + cruise_deg_s / motion.accel_deg_s2)
    if rpm > most:
        raise TaskError(
            f"{source}: motion.period_s = {motion.period_s:g}: that is {rpm:.3g} rpm, and {field} turns at {most:g} "
            f"rpm at most, without a load: take {np.ceil(1000 * least_s) / 1000:g} or more"
        )


def _surface(placed: Placed, folder: Path) -> Surface:
    return cast_surface(folder / placed.file, placed.unit_m, placed.sensor_m, placed.rpy_deg, placed.step_deg)


def _table(region: MapRegion | MeshRegion, folder: Path) -> Array:
    """Weights of a map, or 1 where a mesh is hit and 0 where not."""
    if isinstance(region, MapRegion):
        return read_map(folder / region.file)
    return np.isfinite(_surface(region, folder).range_m).astype(float)

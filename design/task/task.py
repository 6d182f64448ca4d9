"""The task file: regions of interest, products, and the mounting angles to search.

Files contain degrees and millimetres; every key with a unit ends in it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator

from scanwright.design.angles import Angles, AngleSet
from scanwright.design.arrays import Array
from scanwright.design.camera import Camera
from scanwright.design.catalogue.catalogue import Catalogue, load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.deck_holes import DeckHoles
from scanwright.design.errors import ScanwrightError, TaskError, suggest
from scanwright.design.files.faults import NAME, Fault, faults_in, format_faults
from scanwright.design.files.record import Record
from scanwright.design.motion import Motion, Shortest, Sweep
from scanwright.design.scanner import NO_MODULES, Modules, Scanner, scanner_of
from scanwright.design.scene.surface import Surface, cast_surface
from scanwright.design.task.angle_ranges import NAMES, AngleRanges
from scanwright.design.task.map_file import read_map
from scanwright.design.task.named_products import NAMED, motion_faults
from scanwright.design.task.named_record import named_table, names_in
from scanwright.design.task.objective_names import SHIPPED_OBJECTIVES, objectives
from scanwright.design.task.shapes import (
    LITTLE,
    BoxRegion,
    GridStep,
    MapRegion,
    MaskRegion,
    MeshRegion,
    Number,
    Placed,
    PlaneRegion,
    Region,
    Required,
    Value,
    beyond_words,
)

SHIPPED = Path(__file__).parent / "shipped"
SMALLEST_BALL_DEG = 0.01

T = TypeVar("T")

STAND_INS: dict[str, Any] = {
    "name": "unnamed",
    "sensor": "UTM-30LX",
    "servo": "MX-64R",
    "motion": {"mode": "sweep", "limits_deg": (-1.0, 1.0), "period_s": 600.0},
}
"""Valid values that replace faulty keys without a default, so that the other keys can be checked."""


class DensityRules(Record):
    """How density is counted and J is computed; see `docs/definitions.md`, Density and Objective."""

    ball_radius_deg: Number = Field(
        default=2.0, ge=SMALLEST_BALL_DEG, le=90, description="radius in which beams of a direction count"
    )
    objective: str = Field(default="log", description="what J is; see Definitions", examples=[*SHIPPED_OBJECTIVES])
    required: Required = None
    background: Value = Field(default=0.0, description="weight of directions outside of all regions")
    quadrature: Literal["solid_angle", "equal_angle"] = Field(
        default="solid_angle", description="quadrature of J; 'equal_angle' is the sum of the paper"
    )
    grid_step_deg: GridStep = Field(default=1.0, description="grid of that sum")
    tolerance: Number | None = Field(default=None, gt=0, description="largest error of J")
    budget_s: Number | None = Field(default=None, gt=0, description="largest time of one J")

    @field_validator("objective")
    @classmethod
    def _is_an_objective(cls, name: str) -> str:
        if name not in (known := objectives(name)):
            raise ValueError(f"no objective of that name{suggest(name, known)}")
        return name


class Limits(Record):
    """Limits that every reported setting must meet."""

    min_density: Number | None = Field(default=None, ge=1, description="beam density, everywhere in the regions")
    max_line_gap_deg: Number | None = Field(default=None, gt=0, le=360, description="between adjacent scan lines")
    max_blind_cone_deg: Number | None = Field(default=None, ge=0, le=90, description="half angle of the blind cone")
    max_blocked: Number | None = Field(default=None, gt=0, le=1, description="share of the beams that parts block")
    max_blind_weight: Number | None = Field(default=None, ge=0, le=1, description="share of the weight in blind spots")


class Task(Record):
    """One task file with every default written out."""

    name: str = Field(pattern=NAME, description="name of the task and its build folder")
    sensor: str = Field(description="the 2D lidar, by its name in the catalogue")
    servo: str = Field(description="the servo, by its name in the catalogue")
    slip_ring: str | None = Field(default=None, description="the slip ring; a sweep needs none")
    printer: str = Field(default="fdm-0.4", description="printer, by its name in the catalogue")
    catalogue: tuple[str, ...] = Field(default=(), description="your own product files, next to the task")
    deck: DeckHoles | None = Field(default=None, description="holes of the robot's deck for the base mount")
    modules: Modules = Field(default=NO_MODULES, description="optional parts: none by default")
    motion: Annotated[Motion | Shortest, Field(discriminator="mode", description="motion of the servo in one scan")]
    angles: AngleRanges = Field(default=AngleRanges(), description="mounting angles: ranges to search, or values")
    density: DensityRules = Field(default=DensityRules(), description="definition of density and J")
    limits: Limits = Field(default=Limits(), description="limits that every result must meet")
    weight: tuple[Region, ...] = Field(default=(), description="regions of interest; the last one takes precedence")
    mask: tuple[MaskRegion, ...] = Field(default=(), description="regions that the robot hides: excluded")
    scene: Placed | None = Field(default=None, description="a mesh of the surroundings")
    camera: Camera | None = Field(default=None, description="a camera that colours the cloud")

    @model_validator(mode="after")
    def _boxes_need_a_scene(self) -> Task:
        if self.scene is None and any(isinstance(region, BoxRegion) for region in self.weight):
            raise ValueError("a weight of shape = 'box' requires a [scene]")
        return self

    @field_validator("mask")
    @classmethod
    def _masks_hide(cls, masks: tuple[MaskRegion, ...]) -> tuple[MaskRegion, ...]:
        for i, mask in enumerate(masks):
            if not mask.value > 0:
                raise ValueError(f"mask.{i}.value = 0 hides nothing, as masks unite: leave the mask out")
        return masks

    @field_validator("motion", mode="before")
    @classmethod
    def _spins_by_default(cls, motion: Any) -> Any:
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

    def product_names(self) -> dict[str, str | None]:
        """Return the product under each key that names one."""
        return {key: getattr(self, key) for key in NAMED}


@dataclass(frozen=True, slots=True)
class LoadedTask:
    """A task, its file, its products, and its maps.

    `maps` contains the tables of the `map` and `mesh` regions, weights first, then masks, in order; (rows, columns)
    each. `surface` is the surface that the rays into the scene hit.
    """

    task: Task
    source: Path
    products: Catalogue
    maps: tuple[Array, ...]
    surface: Surface | None = None

    def angle_set(self, angles_deg: Sequence[float]) -> AngleSet:
        """Return mounting angles, in the order of `NAMES`, with the products of this task and its motion, if known."""
        task = self.task
        return AngleSet(
            task=task.name,
            angles_deg=Angles(**dict(zip(NAMES, angles_deg, strict=True))),
            sensor=task.sensor,
            servo=task.servo,
            slip_ring=None if self.ring is None else self.ring.name,
            motion=None if isinstance(task.motion, Shortest) else task.motion,
        )

    def scanner(self, angles: AngleSet) -> Scanner:
        """Return the scanner of an angle set, with the printer, the deck and the modules of this task.

        Raises:
            TaskError: a product of the angle set is not in the catalogue.
        """
        return scanner_of(angles, self.task.printer, self.products, self.task.deck, self.task.modules)

    @property
    def lidar(self) -> Lidar:
        """The 2D lidar of the task."""
        return self.products.get(self.task.sensor, Lidar)

    @property
    def servo(self) -> Servo:
        """The servo of the task."""
        return self.products.get(self.task.servo, Servo)

    @property
    def ring(self) -> SlipRing | None:
        """The slip ring of the task; None without one, or for a sweep."""
        name = None if isinstance(self.task.motion, Sweep) else self.task.slip_ring
        return None if name is None else self.products.get(name, SlipRing)

    def warnings(self) -> list[str]:
        """Return warnings of unread servo angles, and of planes outside the lidar's range."""
        return [*self.unread_angles(), *self._out_of_range()]

    def _out_of_range(self) -> list[str]:
        """Return warnings of planes outside the lidar's range; none with a scene, which has all ranges."""
        if self.task.scene is not None:
            return []
        reach_m = self.lidar.practical_range_m
        planes = [
            (f"weight.{i}: {region.words()}", region.share_beyond(reach_m))
            for i, region in enumerate(self.task.weight)
            if isinstance(region, PlaneRegion) and region.value > 0
        ]
        return [
            f"{name}: {beyond_words(beyond)} of it lies beyond the {reach_m:g} m that {self.lidar.name} sees, and J "
            "counts beams that measure nothing there; move it nearer, or use a lidar with a longer range"
            for name, beyond in planes
            if beyond > LITTLE
        ]

    def unread_angles(self) -> list[str]:
        """Return a warning if the servo measures no angle in a part of every turn."""
        seen_deg = self.servo.position_feedback_deg
        if seen_deg < 360 and not isinstance(self.task.motion, Sweep):
            return [
                f"{self.servo.name}: position_feedback_deg = {seen_deg:g}: in {360 - seen_deg:g} deg of every turn no "
                "angle is measured, and scans there have none; use a servo that measures all around, such as MX-64R"
            ]
        return []

    def sha256(self) -> str:
        """Return the digest of all inputs of the result: the task, its maps, and the records of its products."""
        task = self.task.model_dump(mode="json", exclude={"catalogue", "camera"})  # these do not affect the result
        for region in [*task["weight"], *task["mask"]]:
            for key in ("file", "joint_deg", "joint_mm", "frame", "omit"):  # the resulting table is in the digest
                region.pop(key, None)
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


def load_task(source: Path | str | Mapping[str, Any], folder: Path = Path()) -> LoadedTask:
    """Read a task file, a shipped task by its name, or a table with the keys of a task file.

    Args:
        source: the file, the name, or the table.
        folder: of the files that a table names; those of a task file are next to it.

    Raises:
        TaskError: the file is missing or malformed, a product is unknown, a map cannot be read, or the servo
            cannot do the motion.

    Example:
        >>> import scanwright as sw
        >>> sw.load_task("ground_ahead").task.sensor
        'UTM-30LX'
    """
    if isinstance(source, Mapping):
        return _load(dict(source), folder / "task")
    return _load(*named_table(Path(source), SHIPPED, "task"))


def _load(table: dict[str, Any], source: Path) -> LoadedTask:
    """Return the task of a table, with its products and maps; report all faults at once."""
    task, faults = _sound_part(table)
    if task is None:
        raise TaskError(format_faults(faults, source))
    try:
        products = load_catalogue(*(source.parent / extra for extra in task.catalogue))
        own_products = ""
        faults += motion_faults(task.product_names(), task.motion, products)
    except TaskError as error:  # it names lines of other files
        own_products = str(error)
    limits = task.limits
    if isinstance(task.motion, Shortest) and limits.min_density is None and limits.max_line_gap_deg is None:
        aims = "limits.min_density or limits.max_line_gap_deg"
        faults.append(Fault(("motion", "period_s"), f" = 'shortest': requires {aims}"))

    def tried(key: str, read: Callable[[], T]) -> T | None:
        try:
            return read()
        except ScanwrightError as error:
            faults.append(Fault((*key.split("."), "file"), f": {error}"))
            return None

    maps = [
        tried(f"{key}.{i}", partial(_table, region, source.parent))
        for key, regions in (("weight", task.weight), ("mask", task.mask))
        for i, region in enumerate(regions)
        if isinstance(region, MapRegion | MeshRegion)
    ]
    surface = None if task.scene is None else tried("scene", partial(_surface, task.scene, source.parent))
    if faults or own_products:
        raise TaskError("\n".join(each for each in (own_products, format_faults(faults, source)) if each))
    return LoadedTask(task, source, products, tuple(each for each in maps if each is not None), surface)


def _sound_part(table: dict[str, Any]) -> tuple[Task | None, list[Fault]]:
    """Return the task without its faulty keys, so that the rest can be checked, or None; and the faults."""
    try:
        return Task.model_validate(table), []
    except ValidationError as error:
        faults = faults_in(error, Task)
    wrong = {fault.path[0] for fault in faults if fault.path}
    wrong |= {"motion"} if wrong & {"servo", "slip_ring"} else set()  # the motion is checked against these
    sound = {key: value for key, value in table.items() if key not in wrong}
    try:
        return Task.model_validate({key: STAND_INS[key] for key in STAND_INS if key not in sound} | sound), faults
    except ValidationError:
        return None, faults


def shipped_tasks() -> list[str]:
    """Return the names of the shipped tasks."""
    return names_in(SHIPPED)


def _surface(placed: Placed, folder: Path) -> Surface:
    most_m = None if "unit_m" in placed.model_fields_set else placed.most_m
    view = placed.sensor_m, placed.rpy_deg, placed.step_deg
    return cast_surface(folder / placed.file, placed.unit_m, *view, placed.posture, most_m)


def _table(region: MapRegion | MeshRegion, folder: Path) -> Array:
    """Return the weights of a map, or 1 for hits of a mesh and 0 elsewhere."""
    if isinstance(region, MapRegion):
        return read_map(folder / region.file)
    return np.isfinite(_surface(region, folder).range_m).astype(float)

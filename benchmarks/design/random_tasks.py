"""Random tasks of all that a task file can say, written to a folder and loaded as a user's are."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.design.random_regions import (
    Boxes,
    brush_strokes,
    log_uniform,
    on_plane,
    placed,
    random_boxes,
    random_region,
    random_room,
    random_table,
    random_value,
    tiny_region,
)
from scanwright.design.arrays import Array
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import TaskError
from scanwright.design.task.angle_ranges import NAMES, AngleRanges
from scanwright.design.task.shapes import MapRegion, MeshRegion
from scanwright.design.task.task import LoadedTask, load_task

LIDAR_FILE = Path(__file__).parents[2] / "design" / "catalogue" / "ld06.toml"
LIDARS = [product.name for product in load_catalogue() if isinstance(product, Lidar)]
SERVOS = [product.name for product in load_catalogue() if isinstance(product, Servo)]
PERIODS_S, SHORT_S = (1.0, 60.0), (1.0, 4.0)
BALLS_DEG, WIDE_BALLS_DEG = (0.3, 15.0), (4.0, 15.0)
OBJECTIVES = {"log": 0.4, "required": 0.2, "kl": 0.15, "homogeneity": 0.15, "worst": 0.1}
QUADRATURES = {"solid_angle": 0.85, "equal_angle": 0.15}
FIELDS = {
    "everywhere": 0.05,
    "painted": 0.2,
    "tiny": 0.1,
    "metres": 0.15,
    "brush": 0.15,
    "map": 0.1,
    "scene": 0.1,
    "mixed": 0.15,
}
MOTIONS = {"spin": 0.65, "sweep": 0.2, "stop_and_go": 0.15}
MASKS = {"region": 0.4, "plane": 0.15, "map": 0.15, "mesh": 0.3}
TRIES = 200  # of the products, until they can do the motion


@dataclass(frozen=True, slots=True)
class RandomTask:
    """A task, one of its settings, and how it was drawn.

    Attributes:
        field: kind of its weights, of `FIELDS`.
        loaded: the task.
        files: what is in the files that it names: tables of maps, boxes of meshes.
        angles_deg: the setting.
        beams: those that nothing blocks, shape (beams of the lidar,): a fan may have gaps.
    """

    field: str
    loaded: LoadedTask
    files: dict[str, Array | Boxes]
    angles_deg: tuple[float, ...]
    beams: Array

    @property
    def angles_rad(self) -> Array:
        """The setting [rad], shape (4,)."""
        return np.radians(self.angles_deg)

    @property
    def kinds(self) -> tuple[str, ...]:
        """What is counted by: weights, masks, objective, quadrature and motion."""
        task = self.loaded.task
        hidden = sorted({f"mask of {region.shape}" for region in task.mask})
        density = task.density
        return (self.field, *hidden, density.objective, density.quadrature, task.motion.mode)

    def own_tables(self) -> LoadedTask:
        """The task with maps as they were drawn, and with meshes as their boxes say: no ray caster is asked."""
        task, maps = self.loaded.task, []
        for region in (*task.weight, *task.mask):
            if isinstance(region, MapRegion | MeshRegion):
                drawn = self.files[region.file]
                if isinstance(drawn, Boxes):
                    assert isinstance(region, MeshRegion)
                    drawn = np.isfinite(drawn.surface(region).range_m).astype(float)
                maps.append(drawn)
        surface = None
        if task.scene is not None:
            room = self.files[task.scene.file]
            assert isinstance(room, Boxes)
            surface = room.surface(task.scene)
        return replace(self.loaded, maps=tuple(maps), surface=surface)


def drawn(rng: np.random.Generator, kinds: dict[str, float]) -> str:
    """One of several, each with its share of the chances."""
    return str(rng.choice(list(kinds), p=list(kinds.values())))


def random_task(
    rng: np.random.Generator, folder: Path, field: str | None = None, *, small: bool = False, **density: Any
) -> RandomTask:
    """A task with one to three regions or a whole painting, and up to three masks; its files are in the folder.

    Args:
        rng: what it is drawn from.
        folder: where its files are written.
        field: kind of its weights, of `FIELDS`; any if None.
        small: whether its lidar has few beams, its turns are short and its balls wide: every kind of task, but cheap.
        density: what is not left to chance under `[density]`.
    """
    field = field or drawn(rng, FIELDS)
    files: dict[str, Array | Boxes] = {}
    table: dict[str, Any] = {"name": "random", "slip_ring": "SNU11-P0210", "limits": _limits(rng)}
    weight, mask = _regions(rng, field, files)
    if field == "scene":
        table["scene"] = placed(rng, "room.stl")
        files["room.stl"] = random_room(rng)
        middle, size = rng.uniform(-2, 2, 3), log_uniform(rng, 0.5, 4.0)
        weight.append({"shape": "box", "min_m": (middle - size).tolist(), "max_m": (middle + size).tolist()})
    for _ in range(rng.integers(0, 4) if rng.random() < 0.5 else 0):
        mask.append(_mask(rng, files))
    rng.shuffle(mask)
    table |= {"weight": weight, "mask": mask, "density": _density(rng, weight, small) | density}
    units = {
        region["file"]: region.get("unit_m", 1.0)
        for region in [*weight, *mask, table.get("scene", {})]
        if "file" in region
    }
    for name, content in files.items():
        if isinstance(content, Boxes):
            content.write(folder / name, units[name])
        else:
            np.save(folder / name, content)
    loaded = _loaded(rng, table, folder, small)
    low, high = np.array([AngleRanges().limits(name) for name in NAMES]).T
    angles_deg = rng.uniform(low, high)
    if rng.random() < 0.4:  # where edges, poles and lines meet
        step = rng.choice([15, 45, 90])
        angles_deg = np.clip(np.round(angles_deg / step) * step, low, high)
    beams = np.ones(len(loaded.lidar.bearings_rad()), dtype=bool)
    if rng.random() < 0.15:  # behind parts
        first = rng.integers(len(beams))
        beams[first : first + len(beams) // rng.integers(3, 20)] = False
    return RandomTask(field, loaded, files, tuple(angles_deg.tolist()), beams)


def _loaded(rng: np.random.Generator, table: dict[str, Any], folder: Path, small: bool) -> LoadedTask:
    """The task with the first products drawn that can do the motion."""
    mode = drawn(rng, MOTIONS)
    error: Exception = TaskError("never tried")
    for _ in range(TRIES):
        products = {
            "sensor": str(rng.choice(LIDARS)),
            "servo": str(rng.choice(SERVOS)),
            "motion": _motion(rng, mode, small),
        }
        if small or rng.random() < 0.25:
            products |= {"sensor": "odd fan", "catalogue": ["odd_fan.toml"]}
            (folder / "odd_fan.toml").write_text(_odd_fan(rng, small), encoding="utf-8")
        try:
            return load_task(table | products, folder)
        except TaskError as refused:
            if "motion" not in str(refused) and "hits the mesh" not in str(refused):
                raise
            error = refused
            if "hits the mesh" in str(refused):  # no ray meets a box that is far and small
                table["mask"] = [one for one in table["mask"] if one["shape"] != "mesh"]
    raise error


def _odd_fan(rng: np.random.Generator, small: bool) -> str:
    """A lidar of two to a thousand beams that look anywhere, all around or not."""
    turn = int(log_uniform(rng, 20, 120) if small else log_uniform(rng, 5, 1500))
    first = int(rng.integers(0, turn))
    count = turn if rng.random() < 0.3 else int(rng.integers(2, turn + 1))
    steps = {
        "steps_per_turn": turn,
        "first_step": first,
        "last_step": first + count - 1,
        "front_step": int(rng.integers(0, 2 * turn)),
        "scan_rate_hz": float(rng.choice([5.0, 10.0, 12.5, 40.0])),
    }
    text = re.sub(r"^name = .*$", 'name = "odd fan"', LIDAR_FILE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    for key, value in steps.items():
        text = re.sub(rf"^({key} = {{ value =) [\d.]+", rf"\1 {value}", text, flags=re.MULTILINE)
    return text


def _regions(
    rng: np.random.Generator, field: str, files: dict[str, Array | Boxes]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Weights of a kind of field, and masks that come with them."""
    makers: dict[str, Callable[[], dict[str, Any]]] = {
        "painted": lambda: random_region(rng),
        "tiny": lambda: tiny_region(rng),
        "metres": lambda: on_plane(rng),
        "map": lambda: _map(rng, files),
        "everywhere": lambda: {"shape": "all"},
        "scene": lambda: random_region(rng),
    }
    if field == "brush":
        weight, mask = brush_strokes(rng)
        return ([] if rng.random() < 0.5 and weight else [random_region(rng)]) + weight, mask
    if field == "mixed":
        kinds = rng.choice(["painted", "tiny", "metres", "map", "everywhere"], rng.integers(2, 7)).tolist()
    else:
        count = 1 if field == "everywhere" else int(rng.choice([1, 2, 3, 8, 12], p=[0.3, 0.25, 0.25, 0.1, 0.1]))
        kinds = [field] * (min(count, 3) if field == "map" else count)
    weight = [makers[kind]() | {"value": random_value(rng)} for kind in kinds]
    return weight, []


def _map(rng: np.random.Generator, files: dict[str, Array | Boxes]) -> dict[str, Any]:
    name = f"map_{len(files)}.npy"
    files[name] = random_table(rng)
    return {"shape": "map", "file": name}


def _mask(rng: np.random.Generator, files: dict[str, Array | Boxes]) -> dict[str, Any]:
    kind = drawn(rng, MASKS)
    if kind == "region":
        return random_region(rng, largest=0.3)
    if kind == "plane":
        return on_plane(rng)
    if kind == "map":
        return _map(rng, files)
    name = f"mesh_{len(files)}.stl"
    files[name] = random_boxes(rng, int(rng.integers(1, 6)), 1.0)
    return {"shape": "mesh"} | placed(rng, name)


def _density(rng: np.random.Generator, weight: list[dict[str, Any]], small: bool) -> dict[str, Any]:
    objective, quadrature = drawn(rng, OBJECTIVES), drawn(rng, QUADRATURES)
    density: dict[str, Any] = {
        "ball_radius_deg": log_uniform(rng, *(WIDE_BALLS_DEG if small else BALLS_DEG)),
        "objective": objective,
    }
    if objective == "required":
        density["required"] = log_uniform(rng, 1.0, 300.0)
        for region in weight:
            if rng.random() < 0.3:
                region["required"] = float(rng.choice([1.0, 20.0, 100.0]))
    if rng.random() < 0.2:
        density["background"] = random_value(rng)
    if quadrature == "equal_angle":
        density |= {
            "quadrature": quadrature,
            "grid_step_deg": float(rng.choice([5.0, 10.0] if small else [1.0, 2.0, 5.0, 10.0])),
        }
    return density


def _limits(rng: np.random.Generator) -> dict[str, Any]:
    every: dict[str, float] = {
        "min_density": float(rng.integers(1, 5)),
        "max_line_gap_deg": log_uniform(rng, 1.0, 90.0),
        "max_blind_cone_deg": float(rng.choice([0.0, 5.0, 45.0])),
        "max_blind_weight": rng.uniform(0.0, 1.0),
    }
    return {name: value for name, value in every.items() if rng.random() < 0.1}


def _motion(rng: np.random.Generator, mode: str, small: bool) -> dict[str, Any]:
    period_s = log_uniform(rng, *(SHORT_S if small else PERIODS_S))
    if mode == "sweep":
        ends = 15.0 * rng.choice(25, 2, replace=False) - 180 if rng.random() < 0.4 else rng.uniform(-180, 180, 2)
        lower, upper = np.sort(ends).tolist()
        return {"mode": mode, "limits_deg": [lower, upper], "period_s": 2.0 + period_s, "accel_deg_s2": 900.0}
    if mode == "stop_and_go":
        return {
            "mode": mode,
            "stops": int(log_uniform(rng, 1, 50 if small else 700)),
            "dwell_s": log_uniform(rng, 0.03, 0.5),
        }
    # a turn of whole lines, as most people take, in every other task
    return {"period_s": float(round(period_s)) if rng.random() < 0.5 else period_s}

"""Random regions, maps and meshes, as a person paints, measures and exports them, in the words of a task file."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from scanwright.design.arrays import Array
from scanwright.design.frames import Rx, Ry, Rz
from scanwright.design.scene.surface import Surface, cell_directions
from scanwright.design.task.shapes import Placed, Region
from scanwright.studio.state import MOST_DABS, Dab

STEPS_DEG = 1.0, 2.0, 4.0, 5.0, 10.0  # of the rays at a mesh
ROWS = 12, 18, 36, 45, 90, 180  # of a map
REGION: TypeAdapter[Any] = TypeAdapter(Region)


@dataclass(frozen=True, slots=True)
class Boxes:
    """Boxes that may be turned: middles (n, 3), half sizes (n, 3) [m], and rotations (n, 3, 3)."""

    middle_m: Array
    half_m: Array
    R_mesh_box: Array

    def write(self, path: Path, unit_m: float) -> None:
        """Write them as one mesh, in units of the file."""
        import trimesh

        boxes = [trimesh.creation.box(2 * half) for half in self.half_m]
        for box, middle, R in zip(boxes, self.middle_m, self.R_mesh_box, strict=True):
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = R, middle
            box.apply_transform(np.diag([1 / unit_m] * 3 + [1.0]) @ T)
        mesh: Any = trimesh.util.concatenate(boxes)
        mesh.export(path)

    def surface(self, placed: Placed) -> Surface:
        """What rays from where the scanner is placed hit first, in closed form: where they enter and leave each box."""
        d = cell_directions(placed.step_deg)
        roll, pitch, yaw = np.radians(placed.rpy_deg)
        rays = d @ (Rz(yaw) @ Ry(pitch) @ Rx(roll)).T
        range_m, facing = np.full(d.shape[:2], np.inf), np.ones(d.shape[:2])
        for middle, half, R in zip(self.middle_m, self.half_m, self.R_mesh_box, strict=True):
            along, start = rays @ R, (np.array(placed.sensor_m) - middle) @ R
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = np.stack([(-half - start) / along, (half - start) / along])
            enter, leave = ends.min(axis=0), ends.max(axis=0)
            from_outside = enter.max(axis=2) > 0
            here = np.where(from_outside, enter.max(axis=2), leave.min(axis=2))
            face = np.where(from_outside, enter.argmax(axis=2), leave.argmin(axis=2))
            hit = (enter.max(axis=2) <= leave.min(axis=2)) & (leave.min(axis=2) > 0) & (here < range_m)
            range_m = np.where(hit, here, range_m)
            facing = np.where(hit, np.abs(np.take_along_axis(along, face[..., None], axis=2)[..., 0]), facing)
        hit = np.isfinite(range_m)
        points = np.array(placed.sensor_m) + np.where(hit, range_m, 0.0)[..., None] * rays
        return Surface(d, range_m, np.where(hit, np.arccos(np.minimum(facing, 1.0)), np.nan), points)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is spread evenly."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def random_value(rng: np.random.Generator) -> float:
    """A weight: one of few, so that neighbours may have the same, or any."""
    return float(rng.choice([0.5, 1.0])) if rng.random() < 0.5 else float(rng.uniform(0.1, 1))


def random_region(rng: np.random.Generator, largest: float = 1.0) -> dict[str, Any]:
    """A band or a cone, at most a share of all that there is; one of three has edges at whole 15 deg."""
    step = 15.0 if rng.random() < 0.35 else 0.0
    if rng.random() < 0.5:
        axis = np.round(rng.normal(size=3), int(rng.integers(0, 3)))
        axis = axis if axis.any() else np.array([0.0, 0.0, rng.choice([-1.0, 1.0])])
        half = _on_step(log_uniform(rng, 3.0, 180 * largest), step)
        return {"shape": "cone", "axis": axis.tolist(), "half_angle_deg": half}
    low, high = np.sort(rng.uniform(0, 180, 2))
    low, high = _on_step(low, step), _on_step(low + max(1.0, largest * (high - low)), step)
    low = min(low, 165.0)
    high = min(180.0, max(high, low + max(step, 1.0)))
    phi = float(15 * rng.integers(-12, 13)) if step else float(rng.uniform(-180, 180))
    width = 360.0 if rng.random() < 0.1 else _on_step(rng.uniform(5, 360 * largest), step)
    return {"shape": "band", "theta_deg": [low, high], "phi_deg": [phi, phi + width]}


def tiny_region(rng: np.random.Generator) -> dict[str, Any]:
    """A cone or a band down to a thousandth of a degree."""
    if rng.random() < 0.5:
        return {"shape": "cone", "axis": rng.normal(size=3).tolist(), "half_angle_deg": log_uniform(rng, 1e-3, 10)}
    theta, phi = rng.uniform(0, 170), rng.uniform(-180, 180)
    high, wide = (log_uniform(rng, 1.1e-3, 10) for _ in range(2))
    return {"shape": "band", "theta_deg": [theta, theta + high], "phi_deg": [phi, phi + wide]}


def on_plane(rng: np.random.Generator) -> dict[str, Any]:
    """A rectangle of ground, ceiling or wall, from a hand's breadth to a field."""
    while True:
        size = [log_uniform(rng, 0.02, 30) for _ in range(2)]
        region: dict[str, Any] = {"shape": str(rng.choice(["ground", "ceiling", "wall"])), "width_m": size[0]}
        heading = float(rng.integers(-4, 5) * 45) if rng.random() < 0.5 else rng.uniform(-180, 180)
        region |= {"height_m": log_uniform(rng, 0.1, 2), "heading_deg": heading}
        if region["shape"] == "wall":
            bottom = rng.uniform(-1, 2)
            region |= {"distance_m": log_uniform(rng, 0.3, 30), "bottom_m": bottom, "top_m": bottom + size[1]}
        else:
            start = rng.uniform(-5, 5)
            region |= {"from_m": start, "to_m": start + size[1]}
            region |= {"ceiling_m": 2 + log_uniform(rng, 0.1, 5)} if region["shape"] == "ceiling" else {}
        with suppress(ValidationError):  # too thin to be aimed at
            REGION.validate_python(region)
            return region


def brush_strokes(rng: np.random.Generator) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Strokes of the studio's brush, as the task file holds them: cones of weight, and those that hide.

    A stroke leaves a dab each time it has moved half a radius; strokes start anywhere and go over poles and the seam.
    """
    dabs: list[Dab] = []
    for _ in range(rng.integers(1, 4)):
        paints = (log_uniform(rng, 1.0, 60.0), rng.choice(["matters", "matters", "does not matter", "hidden"]))
        value, at = random_value(rng), _unit(rng)
        course = np.cross(at, _unit(rng))
        for _ in range(rng.integers(1, 12)):
            dabs.append(Dab((float(at[0]), float(at[1]), float(at[2])), paints[0], paints[1], value))
            at = at + np.radians(0.55 * paints[0]) * course / np.linalg.norm(course)
            at /= np.linalg.norm(at)
            course = course - (course @ at) * at + 0.2 * np.cross(at, _unit(rng))
    dabs = dabs[:MOST_DABS]
    weight = [dab.cone().model_dump(mode="json", exclude_none=True) for dab in dabs if dab.brush != "hidden"]
    return weight, [dab.cone().model_dump(mode="json", exclude_none=True) for dab in dabs if dab.brush == "hidden"]


def random_table(rng: np.random.Generator) -> Array:
    """Weights of cells: discs of a few cells and of many, over poles and the seam, zero elsewhere."""
    rows = int(rng.choice(ROWS))
    columns = int(rng.choice([rows, 2 * rows, 2 * rows + 1]))
    theta, phi = np.meshgrid(
        (np.arange(rows) + 0.5) * np.pi / rows, (np.arange(columns) + 0.5) * 2 * np.pi / columns, indexing="ij"
    )
    cells = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    table = np.zeros(theta.shape)
    for _ in range(rng.integers(1, 5)):
        inside = cells @ _unit(rng) >= np.cos(np.radians(log_uniform(rng, 200 / rows, 60)))
        added = random_value(rng)
        table = np.where(inside, added if rng.random() < 0.5 else table + added, table)
    if not table.any():
        table[rng.integers(rows), rng.integers(columns)] = 1.0
    return table


def random_boxes(rng: np.random.Generator, count: int, away_m: float) -> Boxes:
    """Boxes about the scanner, touching, overlapping and apart, but never about its optical centre."""
    half, middle = np.exp(rng.uniform(np.log(0.02), np.log(0.5), (count, 3))), np.empty((count, 3))
    for i in range(count):
        middle[i] = _unit(rng) * (np.linalg.norm(half[i]) + rng.uniform(0.02, away_m))
    turned = [Rz(a) @ Ry(b) @ Rx(c) if rng.random() < 0.5 else np.eye(3) for a, b, c in rng.uniform(-3, 3, (count, 3))]
    return Boxes(middle, half, np.array(turned))


def random_room(rng: np.random.Generator) -> Boxes:
    """A room about the scanner, with boxes in it."""
    low, high = -rng.uniform(1.0, 4, 3), rng.uniform(1.0, 4, 3)
    within = random_boxes(rng, int(rng.integers(0, 4)), 0.5)
    return Boxes(
        np.concatenate([[(low + high) / 2], within.middle_m]),
        np.concatenate([[(high - low) / 2], within.half_m]),
        np.concatenate([np.eye(3)[None], within.R_mesh_box]) if len(within.middle_m) else np.eye(3)[None],
    )


def placed(rng: np.random.Generator, file: str) -> dict[str, Any]:
    """A mesh at any resolution, in any unit, and the axes of the world in it."""
    turned = rng.random() < 0.4
    return {
        "file": file,
        "unit_m": float(rng.choice([1.0, 0.001])),
        "step_deg": float(rng.choice(STEPS_DEG)),
        "sensor_m": rng.uniform(-0.01, 0.01, 3).tolist(),
        "rpy_deg": rng.uniform(-180, 180, 3).tolist() if turned else [0.0, 0.0, float(rng.integers(-2, 3) * 90)],
    }


def _unit(rng: np.random.Generator) -> Array:
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def _on_step(angle_deg: float, step_deg: float) -> float:
    return float(max(step_deg, round(angle_deg / step_deg) * step_deg)) if step_deg else float(angle_deg)

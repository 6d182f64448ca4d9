"""The first picture of the report: the scanner in a room that is cut open, and its beam density on floor and walls.

Height and size of the room are those that the task states in metres. Every point of its walls has the colour of its
direction from the optical centre, so one picture serves tasks in metres and in angles. The robot is drawn if the task
has a mesh of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from matplotlib import colormaps
from numpy import ndarray
from PIL import Image
from scipy.ndimage import binary_dilation

from scanwright.design.arrays import Array, Setting
from scanwright.design.evaluation.coverage import UNSEEN, mean_density_at
from scanwright.design.frames import Rx, Ry, Rz
from scanwright.design.objective.problem import Problem
from scanwright.design.scene import ray_caster
from scanwright.design.self_occlusion import SelfOcclusion
from scanwright.design.task.shapes import MeshRegion
from scanwright.design.task.task import Task
from scanwright.report.build_files import png_uri
from scanwright.report.check_pictures import PlacedBody
from scanwright.report.cut_room import Pinhole, Room, Walls, pinhole_behind, room_about, walls_behind
from scanwright.report.density_sphere import Bands, DensitySphere

SQUARE_M, LINE_PX = 1.0, 1.0  # of the grid on floor and walls
ARROW_M, ARROW_WIDE_M = 0.6, 0.05
POST_M = 0.008  # half of the line from the scanner down to the floor
COLOURS = 64  # of the file
INK, LIGHT, MASKED, HATCH, ROBOT = (np.array([float(grey)] * 3) for grey in (17, 255, 221, 119, 150))
HATCH_PX = 16  # period of the hatching
LITTLE = 0.02  # share of the weight below the horizon, under which the floor is cut away


@dataclass(frozen=True, slots=True)
class Mark:
    """A word on the picture, and its middle: shares of the width from the left and of the height from the top."""

    text: str
    left: float
    top: float


@dataclass(frozen=True, slots=True)
class RoomPicture:
    """The picture.

    Attributes:
        picture: PNG as a data address.
        marks: words on it.
        words: description of the room.
    """

    picture: str
    marks: tuple[Mark, ...]
    words: str


def room_picture(
    task: Task,
    folder: Path,
    problem: Problem,
    setting: Setting,
    sphere: DensitySphere,
    scanner: Sequence[PlacedBody],
    shadow: SelfOcclusion | None = None,
) -> RoomPicture:
    """Draw the picture.

    Args:
        task: what was built.
        folder: of the files that it names.
        problem: the same as numbers.
        setting: (alpha_rot, beta_rot, alpha_laser, beta_laser) [rad].
        sphere: bands of the colours, and mean direction of the weight.
        scanner: its bodies about the optical centre; none if unknown.
        shadow: beams that they block; None if unknown.

    Raises:
        BuildError: the shadow is of another number of beams.
    """
    from_below = sphere.below < LITTLE
    room, words = room_about(task)
    camera = pinhole_behind(room, np.array(sphere.middle), from_below)
    rays = camera.rays()
    walls = walls_behind(room, camera, rays)
    picture = _painted(problem, setting, shadow, sphere.bands, camera, walls, room)
    level_m = room.high[2] if from_below else room.low[2]  # of the ceiling, if the floor is cut away
    post = PlacedBody(_post(level_m), False, (0.35, 0.35, 0.35))
    _add_bodies(picture, camera, rays, [*scanner, post, *_robot(task, folder)])
    ahead = np.array([room.high[0] - ARROW_M, 0.0, level_m])
    places = camera.shares(np.array([[0.0, 0, 0], ahead]))
    marks = [Mark(text, *map(float, at.round(4))) for text, at in zip(("scanner", "ahead"), places, strict=True)]
    return RoomPicture(_png(picture), tuple(marks), f"{words}; its squares are {SQUARE_M:g} m wide")


def _painted(
    problem: Problem,
    setting: Setting,
    shadow: SelfOcclusion | None,
    bands: Bands,
    camera: Pinhole,
    walls: Walls,
    room: Room,
) -> Array:
    """Return each pixel's colour, shape (rows, columns, 3), NaN outside."""
    inside, size = walls.inside, camera.size
    points = walls.points_m[inside]
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    density = mean_density_at(problem, setting, directions, shadow)
    weight = problem.field.weight_at(directions)
    masked = problem.field.masked_at(directions)
    colour = 255 * colormaps["cividis"](bands(density))[:, :3]
    colour[density <= UNSEEN] = LIGHT
    row, column = (index.ravel()[inside] for index in np.indices(size))
    hatch = (row + column) % HATCH_PX < HATCH_PX // 4
    colour[masked] = np.where(hatch[masked, None], HATCH, MASKED)
    pixel_m = walls.away_m[inside] * camera.pixel
    colour *= 1 - 0.3 * _squares(points, walls.face[inside] // 2, pixel_m)[:, None]

    picture = np.full((*size, 3), np.nan)
    picture[inside.reshape(size)] = colour
    counted = np.full(len(inside), np.nan)
    counted[inside] = np.where(masked, np.nan, weight)
    _draw(picture, _steps(counted.reshape(size)), 1)
    picture[_steps(walls.face.reshape(size).astype(float))] = INK
    _draw(picture, _arrow(walls, room).reshape(size), 0)
    picture[~inside.reshape(size)] = np.nan
    return picture


def _draw(picture: Array, line: Bool[ndarray, "rows columns"], wider: int) -> None:
    """Draw a line, some pixels wider to every side, with a light one around it."""
    picture[binary_dilation(line, iterations=wider + 2)] = LIGHT
    picture[binary_dilation(line, iterations=wider) if wider else line] = INK


def _squares(points_m: Array, axis: Array, pixel_m: Array) -> Float[ndarray, " n"]:
    """Return the share of a line on each point of a face across an axis; the scanner is on a corner of squares."""
    away = abs(points_m - SQUARE_M * np.round(points_m / SQUARE_M)) / pixel_m[:, None]
    away[np.arange(len(axis)), axis] = np.inf
    return np.clip(LINE_PX - away.min(axis=1) + 0.5, 0, 1)


def _steps(values: Array) -> Bool[ndarray, "rows columns"]:
    """Return pixels whose value differs from the next one to the right or below; NaN differs from nothing."""
    steps = np.zeros(values.shape, bool)
    steps[:, :-1] |= abs(np.diff(values, axis=1)) > 0
    steps[:-1] |= abs(np.diff(values, axis=0)) > 0
    return steps


def _arrow(walls: Walls, room: Room) -> Bool[ndarray, " n"]:
    """Return the points of an arrow on floor or ceiling that ends at the wall ahead of the scanner."""
    before, aside = room.high[0] - walls.points_m[:, 0] - 0.1, abs(walls.points_m[:, 1])
    head = (before > 0) & (before < 3 * ARROW_WIDE_M) & (aside < before * 0.8)
    shaft = (before >= 3 * ARROW_WIDE_M) & (before < ARROW_M) & (aside < ARROW_WIDE_M / 2)
    return (walls.face >= 4) & (head | shaft)


def _post(level_m: float) -> Array:
    """Return a thin post from the scanner to floor or ceiling that shows its place: triangles, shape (4, 3, 3)."""
    r = POST_M
    feet = np.array([[r, r, level_m], [-r, -r, level_m], [r, -r, level_m], [-r, r, level_m]])
    heads = feet * [1, 1, 0]
    return np.array(
        [[feet[i], feet[i + 1], heads[i + 1]] for i in (0, 2)] + [[feet[i], heads[i + 1], heads[i]] for i in (0, 2)]
    )


def _robot(task: Task, folder: Path) -> list[PlacedBody]:
    """Return the meshes that hide directions, about the optical centre."""
    robots = []
    for region in task.mask:
        if isinstance(region, MeshRegion):
            roll, pitch, yaw = np.radians(region.rpy_deg)
            T_world_mesh = np.eye(4)
            T_world_mesh[:3, :3] = (Rz(yaw) @ Ry(pitch) @ Rx(roll)).T
            T_world_mesh[:3, 3] = -T_world_mesh[:3, :3] @ region.sensor_m
            triangles = ray_caster.load_triangles(folder / region.file, region.unit_m, T_world_mesh, region.posture)
            robots.append(PlacedBody(triangles, False, tuple(ROBOT / 255)))
    return robots


def _add_bodies(picture: Array, camera: Pinhole, rays: Array, bodies: Sequence[PlacedBody]) -> None:
    """Draw bodies over the room, lit from the camera."""
    triangles = np.concatenate([body.triangles_m for body in bodies])
    shares = camera.shares(triangles.reshape(-1, 3))
    row, column = np.indices(camera.size)
    at = np.stack([column.ravel(), row.ravel()], axis=1) / camera.size[::-1]
    near = np.flatnonzero(((at > shares.min(axis=0) - 0.01) & (at < shares.max(axis=0) + 0.01)).all(axis=1))
    first_m = ray_caster.cast(ray_caster.build_scene(triangles), camera.eye, rays[near]).range_m
    near, first_m = near[np.isfinite(first_m)], first_m[np.isfinite(first_m)]
    for body in bodies:
        hits = ray_caster.cast(ray_caster.build_scene(body.triangles_m), camera.eye, rays[near])
        front = hits.range_m <= first_m + 1e-6
        light = 0.35 + 0.65 * np.cos(hits.incidence_rad[front])
        picture.reshape(-1, 3)[near[front]] = 255 * light[:, None] * np.array(body.colour)


def _png(picture: Array) -> str:
    """Return the picture as a data address; NaN is transparent."""
    opaque = np.where(np.isnan(picture[..., :1]), 0.0, 255.0)
    pixels = np.concatenate([np.nan_to_num(picture, nan=255.0), opaque], axis=2)
    image = Image.fromarray(pixels.round().astype(np.uint8))
    return png_uri(image.quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE))

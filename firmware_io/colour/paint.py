"""Colours of clouds from images of a camera whose lens and pose are in the task file.

A point gets the colour of its pixel in the image with the nearest optical axis in which it is visible. Visibility
follows from the cloud: each point is a disc that reaches to its neighbours; the discs nearest to the camera are drawn
into a depth image, and points behind them get no colour. Objects that the scanner has not seen hide no points. Discs
face the camera, so those of a slanted surface overlap: a point can be deeper by the slope of its surface over a disc,
plus 5 cm. A disc also covers some of its surroundings: points along the edges of near objects get no colour.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64, UInt8
from numba import njit
from numpy import ndarray
from numpy.typing import NDArray

from scanwright.design import frames
from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Floats, Times
from scanwright.design.camera import Camera
from scanwright.design.errors import TaskError
from scanwright.design.task.task import LoadedTask
from scanwright.firmware_io.clouds.ply import ply_writer, read_header, read_ply
from scanwright.firmware_io.colour.camera_views import CameraView, load_views, opened
from scanwright.firmware_io.poses.trajectory import Trajectory
from scanwright.firmware_io.recording.recording import Recording, open_recording

COLOURS = ("red", "green", "blue", "alpha")
"""Columns of a coloured cloud, bytes; alpha is 255 with a colour, 0 without."""
_AT_ONCE = 1 << 18  # rows, to bound the memory
_NOISE_M = 0.05  # of a range; points so near behind another are visible
_SLANTS = (1.0, 3.0, 10.0)  # tangent of a surface's slant to the camera: smallest, unknown, largest
_BASE_RAD = np.radians(2.0)  # between the points that define the slant, above noise
_STEEP = 6.0  # times the distance at normal incidence, beyond which points are on two surfaces
_WIDEST_PX = 50  # largest disc


@dataclass(frozen=True, slots=True)
class ColourSummary:
    """Counts of points of one cloud: `points == coloured + hidden + outside`."""

    points: int
    coloured: int
    hidden: int
    outside: int
    images: int

    def line(self, cloud: Path) -> str:
        """Format the counts."""
        return (
            f"coloured {self.coloured:,} points of {cloud.name} from {self.images} images; without colour "
            f"{self.hidden:,} behind others, {self.outside:,} in no image"
        )


def painter(
    loaded: LoadedTask, recording: Path, angles: AngleSet, poses: Trajectory | None, lag_s: float, *, organised: bool
) -> Callable[[Path], ColourSummary]:
    """Return a function that colours an organised cloud of a recording in place; options as for `colour_cloud`.

    Raises:
        TaskError: the task has no camera.
        RecordingError: the recording is unreadable, an image does not exist, or its pose is unknown.
    """
    camera, source = loaded.task.camera, open_recording(recording)
    if camera is None:
        raise TaskError(f"{loaded.source}: camera: this task describes no camera; see `scanwright schema`")
    views = load_views(camera, loaded.source.parent, angles, source, poses, lag_s)
    spacing, from_m = spacing_of(source), origin_m(source, angles, poses)
    return lambda cloud: colour_cloud(cloud, camera, views, spacing, from_m, organised=organised)


def colour_cloud(
    path: Path, camera: Camera, views: list[CameraView], spacing: Spacing, from_m: Floats, *, organised: bool = False
) -> ColourSummary:
    """Colour a PLY cloud of `assemble` in place, in constant memory except for seven bytes per point and a depth image.

    Slants are known only in organised clouds. `from_m`: position of the scanner in the cloud, shape (3,), from which
    points get sparser; `organised`: keep the rows without a point.

    Raises:
        RecordingError: an image cannot be read or has another size, or the cloud cannot be written.
    """
    rows, width = read_ply(path), read_header(path).width
    rgb = np.zeros((rows.size, 3), np.uint8)
    nearest_rad = np.full(rows.size, np.inf, np.float32)
    inside = np.zeros(rows.size, np.bool_)
    for view in views:
        with opened(view.file, camera) as image:
            picture = np.array(image.convert("RGB"))
        depth = np.full(picture.shape[:2], np.inf, np.float32)
        for _, seen in _seen(rows, width, camera, view, spacing, from_m):
            _draw(seen.column, seen.row, seen.depth_m, seen.radius_px, depth)
        for begin, seen in _seen(rows, width, camera, view, spacing, from_m):
            which = begin + seen.which
            inside[which] = True
            behind_m = seen.depth_m - depth[seen.row, seen.column]
            better = (behind_m <= _NOISE_M + seen.recedes_m) & (seen.aside_rad < nearest_rad[which])
            which = which[better]
            nearest_rad[which] = seen.aside_rad[better]
            rgb[which] = picture[seen.row[better], seen.column[better]]
    coloured = np.isfinite(nearest_rad)
    _write(path, rows, rgb, coloured, organised=organised)
    points = int(np.isfinite(rows["x"]).sum())
    count = int(coloured.sum())
    return ColourSummary(points, count, int(np.sum(inside & ~coloured)), points - int(inside.sum()), len(views))


@dataclass(frozen=True, slots=True)
class Spacing:
    """Angles between neighbouring beams and neighbouring scan lines [rad]."""

    beam_rad: float
    line_rad: float


def spacing_of(recording: Recording) -> Spacing:
    """Return the spacing of beams of the sensor, and the median rotation of the axis between scans."""
    scan = next(islice(recording.scans(), 1))
    joint_rad = recording.joint_log.angle_at(recording.stamp_ns)
    turned = np.abs(np.diff(joint_rad[np.isfinite(joint_rad)]))
    return Spacing(abs(scan.angle_increment_rad), float(np.median(turned)) if turned.size else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """Points inside an image, all of shape (k,)."""

    which: Int64[ndarray, " n"]
    row: Int64[ndarray, " n"]
    column: Int64[ndarray, " n"]
    depth_m: Float32[ndarray, " n"]
    recedes_m: Float64[ndarray, " n"]
    radius_px: Int64[ndarray, " n"]
    aside_rad: Float32[ndarray, " n"]


def _seen(
    rows: NDArray[np.void], width: int, camera: Camera, view: CameraView, spacing: Spacing, from_m: Floats
) -> Iterator[tuple[int, _Seen]]:
    """Yield the points in an image, visible or not, in parts, and the first row of each part."""
    T_camera_cloud = np.linalg.inv(view.T_cloud_camera)
    at_once = max(_AT_ONCE // width, 1) * width if width else _AT_ONCE
    for begin in range(0, rows.size, at_once):
        part = rows[begin : begin + at_once]
        points_m = np.stack([part[axis] for axis in "xyz"], axis=1).astype(float)
        in_camera = frames.apply(T_camera_cloud, points_m)
        pixels = camera.pixels(in_camera)
        which = np.flatnonzero(np.isfinite(pixels).all(axis=1))
        place = np.rint(pixels[which]).astype(np.int64)
        depth_m = np.linalg.norm(in_camera[which], axis=1)
        range_m = np.linalg.norm(points_m - from_m, axis=1)
        slant, radius_m = (values[which] for values in _discs(in_camera, range_m, width, spacing))
        wide = np.ceil(max(camera.focal_px) * radius_m / depth_m.clip(1e-3)).clip(0, _WIDEST_PX)
        drawn_m = (wide + 1) * depth_m / min(camera.focal_px)  # rounding to pixels at both ends
        aside_rad = np.arctan2(np.hypot(in_camera[which, 0], in_camera[which, 1]), in_camera[which, 2])
        seen = _Seen(
            which=which,
            row=place[:, 1],
            column=place[:, 0],
            depth_m=depth_m.astype(np.float32),
            recedes_m=slant * drawn_m,
            radius_px=wide.astype(np.int64),
            aside_rad=aside_rad.astype(np.float32),
        )
        yield begin, seen


def _discs(in_camera: Floats, range_m: Floats, width: int, spacing: Spacing) -> tuple[Floats, Floats]:
    """Return the tangent of each point's slant to the camera, and the radius of its disc [m], each (n,).

    Both follow from neighbours in an organised cloud; without these, surfaces are assumed to face the scanner.
    """
    least, unknown, most = _SLANTS
    facing_m = np.hypot(spacing.beam_rad, spacing.line_rad) / 2 * range_m
    if not width or len(in_camera) < 2 * width:
        return np.full(len(in_camera), unknown), facing_m
    grid, far_m = in_camera.reshape(-1, width, 3), range_m.reshape(-1, width)
    along, along_m = _tangent(grid, far_m, spacing.beam_rad, axis=1)
    across, across_m = _tangent(grid, far_m, spacing.line_rad, axis=0)
    normal = np.cross(along, across).reshape(-1, 3)
    toward = np.abs(np.einsum("ij,ij->i", normal, in_camera))
    aside = np.linalg.norm(np.cross(normal, in_camera), axis=1)
    slant = np.divide(aside, toward, out=np.full(len(in_camera), most), where=toward > 0)
    known = np.isfinite(aside)
    radius_m = np.where(known, np.hypot(along_m, across_m).ravel() / 2, facing_m)
    return np.where(known, slant.clip(least, most), unknown), radius_m


def _tangent(grid: Floats, far_m: Floats, step_rad: float, axis: int) -> tuple[Floats, Floats]:
    """Return the vector to a point some steps ahead (behind at the end), NaN across surfaces, and its step [m]."""
    steps = int(np.clip(round(_BASE_RAD / step_rad) if step_rad else 1, 1, grid.shape[axis] // 2))
    ahead = np.roll(grid, -steps, axis) - grid
    end = [slice(None)] * 2
    end[axis] = slice(grid.shape[axis] - steps, None)
    ahead[tuple(end)] = (grid - np.roll(grid, steps, axis))[tuple(end)]
    apart_m = np.linalg.norm(ahead, axis=2)
    ahead[apart_m > _STEEP * max(steps * step_rad, _BASE_RAD) * far_m] = np.nan
    return ahead, apart_m / steps


@njit(cache=True)
def _draw(
    column: NDArray[np.int64],
    row: NDArray[np.int64],
    depth_m: NDArray[np.float32],
    radius_px: NDArray[np.int64],
    depth: NDArray[np.float32],
) -> None:
    """Draw discs into a depth image."""
    height, width = depth.shape
    for i in range(column.size):
        r = radius_px[i]
        for v in range(max(row[i] - r, 0), min(row[i] + r + 1, height)):
            for u in range(max(column[i] - r, 0), min(column[i] + r + 1, width)):
                if (u - column[i]) ** 2 + (v - row[i]) ** 2 <= r * r and depth_m[i] < depth[v, u]:
                    depth[v, u] = depth_m[i]


def _write(
    path: Path, rows: NDArray[np.void], rgb: UInt8[ndarray, "n 3"], coloured: Bool[ndarray, " n"], *, organised: bool
) -> None:
    fields_copied = [(name, rows.dtype[name].str) for name in rows.dtype.names or () if name not in COLOURS]
    fields = np.dtype([*fields_copied, *((name, "|u1") for name in COLOURS)])
    comments = [line for line in read_header(path).comments if organised or line.split()[0] not in ("width", "height")]
    with ply_writer(path, fields, comments) as cloud:
        for begin in range(0, rows.size, _AT_ONCE):
            part = slice(begin, begin + _AT_ONCE)
            out = np.empty(rows[part].size, fields)
            for name, _ in fields_copied:
                out[name] = rows[part][name]
            for channel, name in enumerate(COLOURS[:3]):
                out[name] = rgb[part, channel]
            out["alpha"] = np.where(coloured[part], 255, 0)
            cloud.write(out if organised else out[np.isfinite(out["x"])])


def origin_m(recording: Recording, angles: AngleSet, poses: Trajectory | None) -> Float64[ndarray, " 3"]:
    """Return the position of the scanner in its cloud [m], in the middle of the recording, shape (3,)."""
    stood = np.array(angles.t_world_rot_mm) / 1000
    if poses is None:
        return stood
    middle: Times = recording.stamp_ns[[recording.stamp_ns.size // 2]]
    return frames.apply(poses.T_map_world(middle)[0], stood[None])[0]

"""The animation of README: a usual mount becomes the angles that were found, the parts come together, and they scan.

    uv run scanwright build ground_ahead
    SCANWRIGHT_DATA=... uv run python -m benchmarks.scanwright.animation out/ground_ahead

Nothing in it is drawn by hand: the ball shows the mean beams per direction of each setting on the way (dim where
nothing is asked for) and its J, the parts are those of `exploded.glb` and `assembly.glb`, and the points are those that
`scanwright.simulate` measures around the robot of `robot_picture.py`. Needs OpenGL without a screen (Debian: libegl1).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import trimesh
from PIL import Image, ImageDraw, ImageFont

import scanwright as sw
from benchmarks.scanwright.canvas import Canvas
from benchmarks.scanwright.robot_picture import (
    DECK_M,
    box,
    fan,
    height_colours,
    points_of,
    robot_bodies,
    scanner_bodies,
    surroundings,
)
from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Array
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.objective.problem import Problem
from scanwright.design.objective.score import score
from scanwright.design.scene.ray_caster import build_scene
from scanwright.design.task.task import load_task
from scanwright.firmware_io.emulators.simulated import simulated_recording
from scanwright.report.answer import mounting_rad, problem_as_built

MOVIE = Path(__file__).parents[2] / "docs/pictures/from_task_to_cloud.webp"
SIZE = (640, 360)
STILL, FRAME_MS = 14, 80  # frames that the end of a part stands
ROLLING = np.radians([0.0, -90.0, 0.0, 90.0])
DIRECTIONS = 60_000
BALL_EYE, ORIGIN = np.array([3.0, -2.0, -1.0]), np.zeros(3)
BY_SCAN = ("time_ns", "bearing_rad", "range_m", "intensity")
TURNED, PARTED, SCANNED = 26, 18, 30  # frames


def main() -> None:
    """Write the animation."""
    build = Path(sys.argv[1] if len(sys.argv) > 1 else "out/ground_ahead")
    angles = sw.load_angles(build / "angles.json")
    robot = robot_bodies(Path(os.environ["SCANWRIGHT_DATA"]) / "meshes/jackal-base.stl")
    frames = [*found(build, angles), *assembled(build), *scanned(build, angles, robot)]
    frames[0].save(MOVIE, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, quality=30, method=6)


def found(build: Path, angles: AngleSet) -> Iterator[Image.Image]:
    """From a usual mount to the angles that were found."""
    problem = problem_as_built(load_task(build / "task.toml"), angles)
    towards = np.remainder(mounting_rad(angles) - ROLLING + np.pi, 2 * np.pi) - np.pi
    for share in eased(TURNED):
        setting = ROLLING + share * towards
        alpha_rot, beta_rot, alpha_laser, beta_laser = np.degrees(setting)
        words = (
            f"1  angles: axis {alpha_rot:.0f}, {beta_rot:.0f} deg, scan plane {alpha_laser:.0f}, {beta_laser:.0f} deg"
        )
        yield captioned(ball(problem, setting), f"{words}: J = {score(problem, setting).J:.2f}")


def ball(problem: Problem, setting: Array) -> Canvas:
    """Mean beams per direction, dim where nothing is asked for."""
    z = 1 - (2 * np.arange(DIRECTIONS) + 1) / DIRECTIONS
    turn = np.pi * (1 + 5**0.5) * np.arange(DIRECTIONS)  # the golden angle: evenly over the sphere
    level = np.sqrt(1 - z**2)
    directions = np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=1)
    density = mean_density_at(problem, setting, directions)
    colour = matplotlib.colormaps["cividis"](np.clip(np.log(np.maximum(density, 1) / 60) / np.log(30), 0, 1))[:, :3]
    counts = problem.field.weight_at(directions) > 0
    colour[~counts] = 0.25 * colour[~counts] + 0.75
    canvas = Canvas()
    canvas.points(directions, colour, 5.0)
    canvas.mesh(trimesh.creation.icosphere(4, 0.98), (1, 1, 1), light=1.0)
    return canvas


def assembled(build: Path) -> Iterator[Image.Image]:
    """The parts come together."""
    apart, whole = (scanner_bodies(build / name) for name in ("exploded.glb", "assembly.glb"))
    away = np.array([-0.9, 2.2, 0.7])
    for share in eased(PARTED):
        canvas, bounds = Canvas(), []
        for (far, colour), (near, _) in zip(apart, whole, strict=True):
            moved = trimesh.Trimesh((1 - share) * far.vertices + share * near.vertices, near.faces, process=False)
            canvas.mesh(moved, colour)
            bounds.append(moved.bounds)
        low, high = np.min(bounds, axis=(0, 1)), np.max(bounds, axis=(0, 1))
        middle, reach = (low + high) / 2, np.linalg.norm(high - low) / 2
        degrees = float(np.degrees(2 * np.arctan(0.62 * reach / np.linalg.norm(away))))
        yield captioned(canvas, "2  parts: the angles are cut into them", middle + away, middle, degrees)


def scanned(
    build: Path, angles: AngleSet, robot: list[tuple[trimesh.Trimesh, tuple[float, float, float]]]
) -> Iterator[Image.Image]:
    """One full scan, while the scanner turns."""
    bodies = [*surroundings(), *(body for body, _ in robot)]
    triangles = np.concatenate([body.triangles for body in bodies]) - DECK_M
    recording = simulated_recording(angles, build_scene(triangles), sigma_mm=4.0)
    lines, joint_rad = len(recording.range_m), recording.joint_rad[:, 0]
    for last in np.rint(np.concatenate([np.linspace(0, lines, SCANNED + 1)[1:], np.full(2 * STILL, lines)])).astype(
        int
    ):
        so_far = replace(recording, **{name: getattr(recording, name)[:last] for name in BY_SCAN})
        points = points_of(so_far, angles) + DECK_M
        points = points[(points[:, 0] > -1.0) & (points[:, 0] < 5.0) & (abs(points[:, 1]) < 3.0)]
        on_robot = (abs(points[:, 0]) < 0.45) & (abs(points[:, 1]) < 0.25) & (points[:, 2] > 0.02)
        points, now_rad = points[~on_robot], float(joint_rad[last - 1])
        canvas = Canvas()
        for body, colour in robot:
            canvas.mesh(body, colour)
        canvas.mesh(box((6.6, 6.6, 0.002), (1.9, 0, -0.03)), (0.80, 0.82, 0.85), light=0.5)
        T_turned = angles.T_world_rot(now_rad) @ np.linalg.inv(angles.T_world_rot(0.0))
        for mesh, colour in scanner_bodies(build / "assembly.glb", T_turned):
            mesh.apply_translation(DECK_M)
            canvas.mesh(mesh, colour)
        canvas.points(points, height_colours(points[:, 2]), 1.2)
        fan(canvas, angles, now_rad)
        words = f"3  scan: line {last} of {lines}, {len(points):,} points"
        yield captioned(canvas, words, np.array([-1.15, -2.75, 1.75]), np.array([1.15, 0.1, 0.2]), 36)


def captioned(
    canvas: Canvas, words: str, eye: Array = BALL_EYE, target: Array = ORIGIN, degrees: float = 32.0
) -> Image.Image:
    """A frame, and what it shows in words."""
    image = canvas.picture(SIZE, eye, target, degrees=degrees)
    font = ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts/ttf/DejaVuSans.ttf", 16)
    ImageDraw.Draw(image).text(
        (16, SIZE[1] - 30), words, fill=(40, 40, 40), font=font, stroke_width=3, stroke_fill="white"
    )
    return image


def eased(frames: int) -> Array:
    """From 0 to 1, slow at both ends, which stand for a while."""
    share = np.linspace(0, 1, frames)
    return np.concatenate([np.zeros(STILL // 2), 3 * share**2 - 2 * share**3, np.ones(STILL)])


if __name__ == "__main__":
    main()

"""The first picture of README: a robot with the scanner of a build, the floor, and the cloud of one full scan.

    uv run scanwright build ground_ahead
    SCANWRIGHT_DATA=... uv run python -m benchmarks.scanwright.robot_picture out/ground_ahead

The body of the robot is the Clearpath Jackal (clearpathrobotics/jackal, BSD); its mesh is read from the folder of test
data and is not part of this project. The cloud is what `scanwright.simulate` measures in the scene drawn here, every
beam of one full scan, noise included; colours tell the height over the floor.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import matplotlib
import numpy as np
import trimesh

import scanwright as sw
from benchmarks.scanwright.canvas import Canvas
from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Array
from scanwright.design.frames import Rz, rigid
from scanwright.design.scene.ray_caster import build_scene
from scanwright.firmware_io.emulators.simulated import simulated_recording
from scanwright.firmware_io.recording.arrays import RecordingArrays

PICTURE = Path(__file__).parents[2] / "docs/pictures/robot.png"
DECK_M = np.array([0.30, 0.0, 0.62])  # the deck that the scanner hangs from, in the robot's frame on the floor
GREY, DARK, YELLOW = (0.62, 0.64, 0.67), (0.16, 0.17, 0.18), (0.95, 0.74, 0.10)
SIZE = (1600, 900)


def main() -> None:
    """Write `docs/pictures/robot.png`."""
    build = Path(sys.argv[1] if len(sys.argv) > 1 else "out/ground_ahead")
    angles = sw.load_angles(build / "angles.json")
    robot = robot_bodies(Path(os.environ["SCANWRIGHT_DATA"]) / "meshes/jackal-base.stl")
    canvas = Canvas()
    for body, colour in robot:
        canvas.mesh(body, colour)
    canvas.mesh(box((6.6, 6.6, 0.002), (1.9, 0, -0.03)), (0.80, 0.82, 0.85), light=0.5)
    for mesh, colour in scanner_bodies(build / "assembly.glb"):
        mesh.apply_translation(DECK_M)
        canvas.mesh(mesh, colour)
    points = cloud(angles, [*surroundings(), *(body for body, _ in robot)])
    canvas.points(points, height_colours(points[:, 2]), 1.6)
    fan(canvas, angles)
    image = canvas.picture(SIZE, np.array([-1.15, -2.75, 1.75]), np.array([1.15, 0.1, 0.2]), degrees=36)
    image.quantize(128).save(PICTURE, optimize=True)


def box(size: tuple[float, ...], centre: tuple[float, ...], yaw_deg: float = 0.0) -> trimesh.Trimesh:
    """A box, its edges [m], where its centre is, and how far it is turned about z."""
    return trimesh.creation.box(size, rigid(Rz(np.radians(yaw_deg)), centre))


def robot_bodies(jackal: Path) -> list[tuple[trimesh.Trimesh, tuple[float, float, float]]]:
    """The robot on the floor, x ahead: body, wheels, and the mast that the scanner hangs from."""
    body = trimesh.load_mesh(jackal)  # y up, z ahead
    body.apply_transform(np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]]))
    body.apply_translation([0, 0, 0.065])
    wheels = [
        trimesh.creation.cylinder(0.098, segment=[[x, y - 0.02, 0.098], [x, y + 0.02, 0.098]])
        for x in (-0.131, 0.131)
        for y in (-0.188, 0.188)
    ]
    mast = [box((0.03, 0.03, 0.36), (0.0, 0.0, 0.31 + 0.15)), box((0.4, 0.03, 0.03), (0.17, 0, 0.655))]
    plate = [box((0.12, 0.12, 0.006), (DECK_M[0], 0, 0.636))]
    return [(body, YELLOW), *((w, DARK) for w in wheels), *((m, GREY) for m in [*mast, *plate])]


def scanner_bodies(
    glb: Path, T_turned: Array | None = None
) -> list[tuple[trimesh.Trimesh, tuple[float, float, float]]]:
    """The bodies of a GLB of a build in the world's frame, with their colours; those on the axis moved by a pose."""
    scene = trimesh.load_scene(glb)
    y_up_to_z_up = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    bodies = []
    for node in scene.graph.nodes_geometry:
        T, name = scene.graph[node]
        mesh = scene.geometry[name].copy()
        linear = np.array(mesh.visual.material.baseColorFactor[:3]) / 255
        mesh.apply_transform(y_up_to_z_up @ T)
        if T_turned is not None and scene.graph.transforms.parents[node] in ("rot", "laser"):
            mesh.apply_transform(T_turned)
        r, g, b = np.clip(linear ** (1 / 2.2), 0.1, 1)
        bodies.append((trimesh.Trimesh(mesh.vertices, mesh.faces), (float(r), float(g), float(b))))
    return bodies


def surroundings() -> list[trimesh.Trimesh]:
    """The floor and what stands on it."""
    stairs = [box((0.30, 1.4, 0.16 * (k + 1)), (3.4 + 0.3 * k, 1.35, 0.08 * (k + 1))) for k in range(4)]
    return [
        box((30, 30, 0.1), (0, 0, -0.05)),
        box((0.6, 0.4, 0.34), (1.6, 0.8, 0.17), 25),
        box((0.4, 0.4, 0.5), (2.5, -1.0, 0.25), -15),
        box((1.2, 0.15, 0.12), (2.0, -0.3, 0.06), 60),
        trimesh.creation.cylinder(0.05, segment=[[2.6, 0.5, 0], [2.6, 0.5, 1.1]]),
        trimesh.creation.cylinder(0.16, segment=[[3.2, -0.2, 0], [3.2, -0.2, 0.45]]),
        *stairs,
        box((0.1, 7, 1.3), (4.75, 0, 0.65)),
    ]


def cloud(angles: AngleSet, bodies: list[trimesh.Trimesh]) -> Array:
    """Every point of one full scan in the robot's frame [m], shape (n, 3)."""
    triangles = np.concatenate([body.triangles for body in bodies]) - DECK_M
    points = points_of(simulated_recording(angles, build_scene(triangles), sigma_mm=4.0), angles) + DECK_M
    near = (points[:, 0] > -1.0) & (points[:, 0] < 5.0) & (abs(points[:, 1]) < 3.0)
    on_robot = (abs(points[:, 0]) < 0.45) & (abs(points[:, 1]) < 0.25) & (points[:, 2] > 0.02)
    return points[near & ~on_robot]


def points_of(arrays: RecordingArrays, angles: AngleSet) -> Array:
    """Where the beams of a recording end, in the world's frame [m], shape (n, 3)."""
    seen = np.isfinite(arrays.range_m)
    r, b = arrays.range_m[seen], arrays.bearing_rad[seen]
    in_laser = np.stack([r * np.cos(b), r * np.sin(b), np.zeros_like(b), np.ones_like(b)], axis=1)
    points = np.einsum("nij,nj->ni", angles.T_world_laser(arrays.joint_rad[seen]), in_laser)[:, :3]
    return points[np.isfinite(points).all(axis=1)]


def height_colours(height_m: Array) -> Array:
    """Colour of each height, shape (n, 3)."""
    return matplotlib.colormaps["viridis"](0.22 + 0.78 * np.clip(height_m / 1.1, 0, 1))[:, :3]


def fan(canvas: Canvas, angles: AngleSet, joint_rad: float = 0.0) -> None:
    """The beams of one scan at an angle of the servo, as a translucent sector where the lidar stands; and the axis."""
    T = angles.T_world_rot(joint_rad)
    centre = T[:3, 3] + DECK_M
    bearing = np.radians(np.linspace(-135, 135, 91))
    rim = 0.42 * np.stack([np.cos(bearing), np.sin(bearing), 0 * bearing], axis=1)
    rim = rim @ (T[:3, :3] @ angles.T_rot_laser()[:3, :3]).T + centre
    corners = np.vstack([centre, rim])
    faces = [[0, k, k + 1] for k in range(1, len(rim))]
    canvas.mesh(trimesh.Trimesh(corners, faces, process=False), (0.85, 0.1, 0.1), 0.3, light=1.0)
    canvas.line(np.array([centre - 0.3 * T[:3, 2], centre + 0.45 * T[:3, 2]]), (0.1, 0.1, 0.1), 0.003)


if __name__ == "__main__":
    main()

"""The scanner in 3D for the report: bodies, their exploded places, axis, field of view.

Matrices are column by column, arrays little-endian in base64, in the world frame in metres. Corners are in 65,535 steps
of the box of the body, and its matrices start from there.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Array, Vector
from scanwright.design.frames import apply
from scanwright.design.motion import Sweep
from scanwright.design.scene.ray_caster import build_scene, load_triangles
from scanwright.design.self_occlusion import AXIS_STEPS, SelfOcclusion
from scanwright.design.task.shapes import MeshRegion
from scanwright.design.task.task import Task
from scanwright.report.build_files import numbers
from scanwright.report.check_pictures import PlacedBody

LARGEST_BYTES = 6_000_000  # of assembly.glb, of the 8 MB that a report may have: as much without normals in base64
FULL_TURN_DEG = (0.0, 360.0)
A_TURN_S = 10.0  # shown if the motion is unknown
SQUARE_M = 0.05  # of the grid below the scanner
FAN_REACH = 0.9  # of the radius of the scanner: how far the fan and the axis are drawn
Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # glTF has y up
FRAMES = ("rot", "laser")
STEPS = 2**16 - 1
MOST_TRIANGLES = 30_000  # of a robot, 300 kB of the page; of more only the hatching is shown
GREY = 0.6  # of a robot


def load_glb(path: Path) -> Any:
    """Return a scene of trimesh, as `cad` writes it.

    Raises:
        ValueError: a frame of the scanner is missing.
    """
    import trimesh

    scene = trimesh.load_scene(path, process=False)
    if missing := set(FRAMES) - set(scene.graph.nodes):
        raise ValueError(f"no frame {' and '.join(sorted(missing))}")
    return scene


def scanner_scene(
    assembly: Any, exploded: Any | None, angles: AngleSet, own_body: tuple[SelfOcclusion, Array] | None
) -> dict[str, Any]:
    """Return the scanner for the stage, ready for JSON.

    Without `exploded` nothing explodes; without `own_body` (hidden beams, bearings [rad]) there is no field of view.
    """
    turning = assembly.graph.transforms.successors("rot")
    bodies, together, spread = [], [], []
    for node in sorted(assembly.graph.nodes_geometry):
        T_world_body, mesh = _pose(assembly, node), assembly.geometry[assembly.graph.get(node)[1]]
        T_apart = T_world_body if exploded is None else _pose(exploded, node)
        together.append(apply(T_world_body, mesh.vertices))
        spread.append(apply(T_apart, mesh.vertices))
        body = _body(mesh.vertices, mesh.faces, T_world_body, _srgb(mesh.visual.material.baseColorFactor))
        apart = _column_by_column(T_apart @ _T_body_box(mesh.vertices))
        bodies.append(body | {"name": node, "turns": node in turning, "apart": apart})
    T_world_rot, T_world_laser = _pose(assembly, "rot"), _pose(assembly, "laser")
    reach = FAN_REACH * _fit(together)["radius"]
    grid = _grid(np.concatenate(together))
    side_m = grid["square"] * (grid["squares"] + 0.5)  # to the tip of the arrow ahead
    together.append(np.array([[side_m, 0.0, grid["z"]]]))
    if own_body is not None:  # the fan comes round everywhere within its reach of the axis
        together.append(T_world_laser[:3, 3] + reach * np.concatenate([np.eye(3), -np.eye(3)]))
    return {
        "bodies": bodies,
        "fit": _fit(together),
        "fit_apart": _fit(spread),
        "explodes": exploded is not None,
        "grid": grid,
        "axis": _column_by_column(T_world_rot),
        "axis_inverse": _column_by_column(np.linalg.inv(T_world_rot)),
        "reach": round(reach, 6),
        "limits_deg": list(angles.motion.limits_deg if isinstance(angles.motion, Sweep) else FULL_TURN_DEG),
        "period_s": A_TURN_S if angles.motion is None else angles.motion.duration_s,
        "to_and_fro": isinstance(angles.motion, Sweep),
        "laser": _column_by_column(T_world_laser),
        "fan": None if own_body is None else _fan(*own_body),
    }


def robot_bodies(task: Task, folder: Path, centre_m: Vector) -> list[dict[str, Any]]:
    """Return the meshes that hide directions, from files of a folder, for the stage."""
    robots = []
    for region in task.mask:
        if isinstance(region, MeshRegion):
            T_world_mesh = np.eye(4)
            T_world_mesh[:3, :3] = region.R_mesh_world().T
            T_world_mesh[:3, 3] = centre_m - T_world_mesh[:3, :3] @ region.sensor_m
            triangles = load_triangles(folder / region.file, region.unit_m, T_world_mesh, region.posture)
            if len(triangles) <= MOST_TRIANGLES:
                corners = triangles.reshape(-1, 3)
                body = _body(corners, np.arange(len(corners)).reshape(-1, 3), np.eye(4), [GREY] * 3)
                robots.append(body | {"name": "robot", "turns": False, "apart": body["matrix"]})
    return robots


def placed_bodies(assembly: Any) -> dict[str, PlacedBody]:
    """Return the bodies of `assembly.glb` in the world."""
    turning = assembly.graph.transforms.successors("rot")
    bodies = {}
    for node in sorted(assembly.graph.nodes_geometry):
        mesh = assembly.geometry[assembly.graph.get(node)[1]]
        triangles = apply(_pose(assembly, node), mesh.vertices)[mesh.faces]
        bodies[node] = PlacedBody(
            build_scene(triangles, node), node in turning, tuple(_srgb(mesh.visual.material.baseColorFactor))
        )
    return bodies


def _pose(scene: Any, node: str) -> Array:
    """Return T_world_node, z up [m]."""
    return Y_TO_Z @ scene.graph.get(node)[0]


def _body(vertices: Array, faces: Array, T_world_body: Array, colour: list[float]) -> dict[str, Any]:
    """Return a body for the stage: corners in steps of its box."""
    corners, number = np.unique(vertices, axis=0, return_inverse=True)  # they differ in their normals
    wide, T_body_box = len(corners) > STEPS, _T_body_box(vertices)
    return {
        "colour": colour,
        "matrix": _column_by_column(T_world_body @ T_body_box),
        "vertices": numbers(np.round((corners - T_body_box[:3, 3]) / np.diag(T_body_box)[:3] * STEPS), "<u2"),
        "faces": numbers(number.reshape(-1)[faces], "<u4" if wide else "<u2"),
        "wide": wide,
    }


def _T_body_box(vertices: Array) -> Array:
    """Return the transform from the unit cube to the box of a body."""
    T = np.diag([*np.maximum(np.ptp(vertices, axis=0), 1e-9), 1.0])
    T[:3, 3] = vertices.min(axis=0)
    return T


def _fan(shadow: SelfOcclusion, bearings_rad: Array) -> dict[str, Any]:
    """Return bearings, and for every beam that is ever hidden one bit an axis step, 1 if it is."""
    stator = np.zeros((len(bearings_rad), AXIS_STEPS), bool) if shadow.stator is None else shadow.stator
    hidden = stator | shadow.beams[:, None]
    rows = {str(beam): numbers(np.packbits(hidden[beam]), "u1") for beam in np.flatnonzero(hidden.any(axis=1))}
    return {"bearings": numbers(bearings_rad, "<f4"), "steps": hidden.shape[1], "hidden": rows}


def _grid(points: Array) -> dict[str, Any]:
    """Return squares below all points, about the z axis of the world, and their number to each side."""
    reach = float(np.abs(points[:, :2]).max())
    return {
        "z": round(float(points[:, 2].min()), 6),
        "square": SQUARE_M,
        "squares": int(np.ceil(reach / SQUARE_M)) + 1,
    }


def _fit(points: list[Array]) -> dict[str, Any]:
    """Return a sphere about the middle of the box of all points."""
    every = np.concatenate(points)
    middle = (every.min(axis=0) + every.max(axis=0)) / 2
    radius = float(np.linalg.norm(every - middle, axis=1).max())
    return {"centre": np.round(middle, 6).tolist(), "radius": round(radius, 6)}


def _srgb(linear: ArrayLike) -> list[float]:
    """Convert linear colours of glTF, 0 to 255 in trimesh, to sRGB, 0 to 1."""
    c = np.asarray(linear, dtype=float)[:3] / 255
    return np.round(np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055), 3).tolist()


def _column_by_column(matrix: Array) -> list[float]:
    return (np.round(matrix, 9).T.ravel() + 0.0).tolist()

"""The scanner in 3D, binary glTF 2.0: `assembly.glb` in the tree of its frames, and `exploded.glb` in build order.

    y_up - world - servo - rot - laser, the frames of `scanner.urdf`; each body is in the frame that it moves with.

Exploded, each product is lifted along the rotation axis until it is free of those below it; lidar and sub-plate move
along the lidar's z, a counterweight along its radius.

Metres. glTF is y-up and the project z-up: one root node turns z to y. Normals are smooth on round surfaces, sharp at
edges. The same scene gives the same bytes.
"""

import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, BASE_MOUNT, FIXED_CABLES, LIDAR, ROTOR_LEADS
from scanwright.cad.layout.rotor.counterweight import Counterweight
from scanwright.design.arrays import Array
from scanwright.design.scanner import Scanner

GAP_MM = 15.0  # between the products of the exploded view
FLOAT, UINT16, UINT32 = 5126, 5123, 5125
VERTICES, INDICES = 34962, 34963
Z_TO_Y = [-0.7071067811865476, 0.0, 0.0, 0.7071067811865476]  # quaternion of a quarter turn about -x
CREASE_RAD = np.radians(25.0)  # faces that meet at more have an edge between them; facets of a round meet at 0.1 rad
NORMAL_DECIMALS = 4
QUARTERS = 4  # of a turn: linear interpolation of quaternions is exact between them at constant speed

Surface = tuple[Array, Array, NDArray[np.int64]]
"""Vertices (n, 3) [mm], their unit normals (n, 3) and three of them for each face (3 m,)."""


@dataclass(frozen=True, slots=True)
class Node:
    """One frame or body of the scene."""

    name: str  # unique
    parent: str  # name of its parent node; empty for the root
    T_parent_node: Array  # its pose [m], shape (4, 4)
    mesh: TriMesh | None = None  # in the frame of the node [mm]; None for a bare frame
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)  # sRGB, 0 to 1
    metal: bool = False  # whether the surface is bare metal


def glb_bytes(
    nodes: list[Node], surfaces: Mapping[str, Surface], extras: dict[str, Any], spin: tuple[str, float] | None = None
) -> bytes:
    """Return the file of a scene.

    Of `nodes` the first is the root, and parents come before children; `surfaces` are those of `shaded` by node; `spin`
    is a node that turns counter-clockwise about its z, and the seconds of one turn.
    """
    index = {node.name: i + 1 for i, node in enumerate(nodes)}
    children: dict[str, list[int]] = {}
    for node in nodes[1:]:
        children.setdefault(node.parent, []).append(index[node.name])
    buffer = _Buffer()
    materials: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    entries: list[dict[str, Any]] = [{"name": "y_up", "rotation": Z_TO_Y, "children": [1]}]
    for node in nodes:
        entry: dict[str, Any] = {"name": node.name}
        if not np.array_equal(node.T_parent_node, np.eye(4)):
            entry["matrix"] = (np.round(node.T_parent_node, 12).T + 0.0).ravel().tolist()
        if node.mesh is not None:
            material = _material(node)
            if material not in materials:
                materials.append(material)
            number = materials.index(material)
            meshes.append({"name": node.name, "primitives": [_primitive(buffer, surfaces[node.name], number)]})
            entry["mesh"] = len(meshes) - 1
        if node.name in children:
            entry["children"] = children[node.name]
        entries.append(entry)
    scene = {
        "asset": {"version": "2.0", "generator": "scanwright", "extras": extras},
        "scene": 0,
        "scenes": [{"name": nodes[0].name, "nodes": [0]}],
        "nodes": entries,
        "meshes": meshes,
        "materials": materials,
    }
    if spin is not None:
        scene["animations"] = [_turning(buffer, index[spin[0]], spin[1])]
    scene |= {
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }
    text = json.dumps(scene, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(buffer.data), b"BIN\0") + bytes(buffer.data)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


class _Buffer:
    """The growing binary chunk; everything in it starts at a multiple of four bytes."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: Array, kind: str, component: int, target: int | None = None, **facts: Any) -> int:
        content = values.tobytes()
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(content)}
        if target is not None:
            view["target"] = target
        self.data += content + b"\0" * (-len(content) % 4)
        self.views.append(view)
        count = len(values)
        self.accessors.append(
            {"bufferView": len(self.views) - 1, "componentType": component, "count": count, "type": kind, **facts}
        )
        return len(self.accessors) - 1


def _primitive(buffer: _Buffer, surface: Surface, material: int) -> dict[str, Any]:
    vertices, normals, corners = surface
    points = (vertices / 1000).astype("<f4")
    low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    position = buffer.add(points, "VEC3", FLOAT, VERTICES, min=low, max=high)
    normal = buffer.add(normals.astype("<f4"), "VEC3", FLOAT, VERTICES)
    short = len(points) < 2**16 - 1
    indices = buffer.add(corners.astype("<u2" if short else "<u4"), "SCALAR", UINT16 if short else UINT32, INDICES)
    return {"attributes": {"POSITION": position, "NORMAL": normal}, "indices": indices, "material": material}


def shaded(mesh: TriMesh) -> Surface:
    """Return vertices (n, 3) [mm], their unit normals (n, 3) and three of them for each face (3 m,).

    A vertex is repeated for each of its normals. The normal at a corner is the mean of those of the faces around it
    without an edge towards this one, weighted by their angles.
    """
    corners, vertex, (normal, area) = mesh.vertices[mesh.faces], mesh.faces.ravel(), mesh.across()
    one, other = _about_one_vertex(vertex)
    alike = np.einsum("ij,ij->i", normal[one // 3], normal[other // 3]) > np.cos(CREASE_RAD)
    alike |= area[one // 3] == 0  # a sliver has no normal of its own
    weight = np.where(alike, _widths(corners).ravel()[other], 0.0)
    mean = np.stack([np.bincount(one, weight * normal[other // 3, k], len(vertex)) for k in range(3)], axis=1)
    unit = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    keys = np.column_stack([vertex, np.round(unit, NORMAL_DECIMALS) + 0.0])
    distinct, number = np.unique(keys, axis=0, return_inverse=True)
    return mesh.vertices[distinct[:, 0].astype(int)], distinct[:, 1:], number.ravel()


def _about_one_vertex(vertex: NDArray[np.int64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return all pairs of corners at the same vertex, a corner with itself included."""
    order = np.argsort(vertex, kind="stable")
    counts = np.bincount(vertex)
    first = np.cumsum(counts) - counts
    partners = counts[vertex]
    one = np.repeat(np.arange(len(vertex)), partners)
    turn = np.arange(len(one)) - np.repeat(np.cumsum(partners) - partners, partners)
    return one, order[first[vertex[one]] + turn]


def _widths(corners: Array) -> Array:
    """Return the angles of triangles (m, 3, 3) at their corners [rad], shape (m, 3)."""
    forth = np.roll(corners, -1, axis=1) - corners
    back = np.roll(corners, 1, axis=1) - corners
    across = np.linalg.norm(np.cross(forth, back), axis=2)
    return np.arctan2(across, np.einsum("mij,mij->mi", forth, back))


def _material(node: Node) -> dict[str, Any]:
    """Return the material: colours of the format are linear, ours are sRGB."""
    linear = [round(c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4, 4) for c in node.colour]
    metal, rough = (0.9, 0.35) if node.metal else (0.0, 0.7)
    return {
        "pbrMetallicRoughness": {"baseColorFactor": [*linear, 1.0], "metallicFactor": metal, "roughnessFactor": rough}
    }


def _turning(buffer: _Buffer, node: int, period_s: float) -> dict[str, Any]:
    quarter = np.arange(QUARTERS + 1)
    times = (quarter * period_s / QUARTERS).astype("<f4")
    half_turn = quarter * np.pi / QUARTERS
    zero = np.zeros(QUARTERS + 1)
    turns = np.round(np.stack([zero, zero, np.sin(half_turn), np.cos(half_turn)], axis=1), 9).astype(
        "<f4"
    ) + np.float32(0)
    when = buffer.add(times, "SCALAR", FLOAT, min=[float(times[0])], max=[float(times[-1])])
    sampler = {"input": when, "output": buffer.add(turns, "VEC4", FLOAT), "interpolation": "LINEAR"}
    channel = {"sampler": 0, "target": {"node": node, "path": "rotation"}}
    return {"name": "spin", "samplers": [sampler], "channels": [channel]}


def scene_files(scanner: Scanner, assembly: Assembly, meshes: dict[str, TriMesh], config_hash: str) -> dict[str, bytes]:
    """Return both files; `meshes` are of the made parts, rotation frame."""
    T = scanner.angles.T_rot_laser()
    nodes = [
        Node("world", "", np.eye(4)),
        Node("servo", "world", scanner.angles.T_world_rot(0.0)),
        Node("rot", "servo", np.eye(4)),
        Node("laser", "rot", T),
    ]
    for name in (*assembly.made, *assembly.bought):
        spec = assembly.spec(name)
        frame = spec.frame
        mesh = meshes[name] if name in meshes else assembly.mesh(name)
        if frame == "laser":
            mesh = TriMesh(np.round((mesh.vertices - T[:3, 3] * 1000) @ T[:3, :3], 6) + 0.0, mesh.faces)
        nodes.append(Node(name, frame, np.eye(4), mesh, spec.colour, name in assembly.metal()))
    motion = scanner.angles.motion
    spin = ("rot", motion.period_s) if motion is not None and motion.mode == "spin" else None
    extras = {"task": scanner.angles.task, "config": config_hash, "unit": "m"}
    surfaces = {node.name: shaded(node.mesh) for node in nodes if node.mesh is not None}
    return {
        "assembly.glb": glb_bytes(nodes, surfaces, extras, spin),
        "exploded.glb": glb_bytes(_exploded(nodes, assembly, T), surfaces, extras),
    }


def _exploded(nodes: list[Node], assembly: Assembly, T_rot_laser: Array) -> list[Node]:
    lifts = _lifts(nodes, assembly, T_rot_laser)
    to_rot = {"servo": np.eye(3), "rot": np.eye(3), "laser": T_rot_laser[:3, :3]}
    moved = []
    for node in nodes:
        if node.mesh is not None:
            shifted = np.eye(4)
            shifted[:3, 3] = np.round(to_rot[node.parent].T @ lifts[assembly.thing(node.name)] / 1000, 9) + 0.0
            node = replace(node, T_parent_node=shifted)
        moved.append(node)
    return moved


def _lifts(nodes: list[Node], assembly: Assembly, T_rot_laser: Array) -> dict[str, Array]:
    """Return the displacement of each product in the exploded view, in the rotation frame [mm]."""
    clouds: dict[str, list[Array]] = {}
    for node in nodes:
        if node.mesh is not None:
            cloud = node.mesh.vertices
            if node.parent == "laser":
                cloud = cloud @ T_rot_laser[:3, :3].T + T_rot_laser[:3, 3] * 1000
            clouds.setdefault(assembly.thing(node.name), []).append(cloud)
    points = {product: np.concatenate(parts) for product, parts in clouds.items()}
    axis, out = np.array([0.0, 0.0, 1.0]), T_rot_laser[:3, 2]
    lifts: dict[str, Array] = {}
    top = -np.inf
    along = {name: part.lifted for name, part in assembly.parts.items() if name in points} | {LIDAR: "lidar"}
    stacked = [product for product in assembly.layout.drive.stacked if product in points]
    for product in stacked:
        low, high = float(points[product][:, 2].min()), float(points[product][:, 2].max())
        lift = max(0.0, top + GAP_MM - low)
        lifts[product] = lift * axis
        top = high + lift
    normal = np.array(assembly.layout.deck.normal)
    lifts |= {product: -GAP_MM * normal for product in along if along[product] == "deck"}
    if ROTOR_LEADS in points:  # they stay where they run, at the linkage
        lifts[ROTOR_LEADS] = lifts[ALIGNMENT_LINKAGE]
    if FIXED_CABLES in points:  # likewise, at the mount or the deck
        lifts[FIXED_CABLES] = lifts.get(BASE_MOUNT, np.zeros(3))
    top, linkage = float((points[ALIGNMENT_LINKAGE] @ out).max()), lifts[ALIGNMENT_LINKAGE]
    bar = assembly.layout.counterweight
    for product in (product for product in along if along[product] == "radius"):
        assert isinstance(bar, Counterweight)
        away = np.array([math.cos(bar.ear.azimuth), math.sin(bar.ear.azimuth), 0.0])
        shift = (bar.ear.end - bar.start + GAP_MM) * away
        lifts[product] = linkage + shift
        top = max(top, float(((points[product] + shift) @ out).max()))
    for product in (product for product in along if along[product] == "lidar"):
        heights = points[product] @ out
        lift = top + GAP_MM - float(heights.min())
        lifts[product] = linkage + lift * out
        top = float(heights.max()) + lift
    return lifts

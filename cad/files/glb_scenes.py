"""The scanner in 3D: `assembly.glb` in the tree of its frames, and `exploded.glb` in build order.

    y_up - world - servo - rot - laser, the frames of `scanner.urdf`; each body is in the frame that it moves with.

Exploded, each product is lifted along the rotation axis until it is free of those below it; lidar and sub-plate move
along the lidar's z, a counterweight along its radius.
"""

import math
from dataclasses import replace

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.files.glb import Node, glb_bytes, shaded
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, BASE_MOUNT, FIXED_CABLES, LIDAR, ROTOR_LEADS
from scanwright.cad.layout.rotor.counterweight import Counterweight
from scanwright.design.arrays import Array
from scanwright.design.scanner import Scanner

GAP_MM = 15.0  # between the products of the exploded view


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

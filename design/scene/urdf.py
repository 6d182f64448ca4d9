"""The robot of a URDF as triangles: the geometry of its links, placed by the values of its joints."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from urllib.parse import unquote, urlparse
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial.transform import Rotation

from scanwright.design import frames
from scanwright.design.arrays import Pose
from scanwright.design.errors import SceneError, suggest
from scanwright.design.scene.mesh_file import mesh_file
from scanwright.design.scene.posture import AS_IT_IS, SUFFIX, Posture


def urdf_triangles(path: Path, posture: Posture = AS_IT_IS) -> Float[ndarray, "t 3 3"]:
    """Return the corners of the visible geometry of a robot [m], shape (t, 3, 3).

    A link without visible geometry has that of its collisions. Meshes are in metres, times their scale; a DAE has its
    own unit. `package://NAME/` is a folder NAME above the URDF, or the nearest that contains the rest of the path.

    Raises:
        SceneError: the file is no URDF, a mesh is missing, or the posture names what the robot does not have.
    """
    try:
        return _triangles(path, _robot(path), posture)
    except SceneError:
        raise
    except ValueError as error:
        raise SceneError(f"{path}: {error}") from error


def _triangles(path: Path, robot: ElementTree.Element, posture: Posture) -> Float[ndarray, "t 3 3"]:
    links = {link.get("name", ""): link for link in robot.iter("link")}
    T_root = dict(_link_poses(path, robot, links, posture))
    for name in (posture.frame, *posture.omit):
        if name and name not in T_root:
            raise SceneError(f"{path}: no link '{name}'{suggest(name, T_root)}")
    T_frame_root = np.linalg.inv(T_root[posture.frame]) if posture.frame else np.eye(4)
    parts = [
        frames.apply(T_frame_root @ T_root[name] @ _origin(shape), corners_m.reshape(-1, 3)).reshape(-1, 3, 3)
        for name, link in links.items()
        if name not in posture.omit
        for shape in link.findall("visual") or link.findall("collision")
        for corners_m in _geometry(path, name, shape)
    ]
    if not parts:
        raise SceneError(f"{path}: no link has a geometry")
    return np.concatenate(parts)


def _robot(path: Path) -> ElementTree.Element:
    try:
        robot = ElementTree.fromstring(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, ElementTree.ParseError) as error:
        raise SceneError(f"{path}: not a readable URDF: {error}") from error
    if robot.tag != "robot" or robot.find("link") is None:
        raise SceneError(f"{path}: not a URDF: the root is <{robot.tag}>, allowed <robot> with links")
    if any("xacro" in part.tag for part in robot.iter()):
        raise SceneError(f"{path}: contains xacro: run `xacro {path.name} > robot{SUFFIX}` and name that file")
    return robot


def _link_poses(
    path: Path, robot: ElementTree.Element, links: Mapping[str, object], posture: Posture
) -> Iterator[tuple[str, Pose]]:
    """Yield links with their poses in the root, parents first."""
    joints = [joint for joint in robot.findall("joint") if joint.find("parent") is not None]
    named = {joint.get("name", ""): joint for joint in joints}
    for name in (*posture.joint_deg, *posture.joint_mm):
        if name not in named:
            raise SceneError(f"{path}: no joint '{name}'{suggest(name, named)}")
    children = {_end(joint, "child") for joint in joints}
    poses = {name: np.eye(4) for name in links if name not in children}
    yield from poses.items()
    waiting = joints
    while waiting:
        placed = [joint for joint in waiting if _end(joint, "parent") in poses]
        if not placed:
            raise SceneError(f"{path}: joint '{waiting[0].get('name')}' is not connected to the root")
        for joint in placed:
            child = _end(joint, "child")
            poses[child] = poses[_end(joint, "parent")] @ _origin(joint) @ _moved(joint, _value(joint, named, posture))
            yield child, poses[child]
        waiting = [joint for joint in waiting if joint not in placed]


def _value(joint: ElementTree.Element, named: Mapping[str, ElementTree.Element], posture: Posture) -> float:
    """Return the value of a joint [rad, m]; one that mimics another follows it."""
    name = joint.get("name", "")
    mimic = joint.find("mimic")
    if mimic is not None and name not in posture.joint_deg and name not in posture.joint_mm:
        leader = named.get(mimic.get("joint", ""))
        others = {key: each for key, each in named.items() if each is not joint}  # joints may mimic in a circle
        led = 0.0 if leader is None or leader is joint else _value(leader, others, posture)
        return float(mimic.get("multiplier", 1)) * led + float(mimic.get("offset", 0))
    return math.radians(posture.joint_deg.get(name, 0.0)) + posture.joint_mm.get(name, 0.0) / 1000


def _moved(joint: ElementTree.Element, value: float) -> Pose:
    node = joint.find("axis")
    axis = np.array([1.0, 0, 0]) if node is None else _numbers(node, "xyz", 3, 0.0)
    axis /= np.linalg.norm(axis) or 1.0
    if joint.get("type") == "prismatic":
        return frames.rigid(np.eye(3), value * axis)
    if joint.get("type") in ("revolute", "continuous"):
        return frames.rigid(Rotation.from_rotvec(value * axis).as_matrix(), np.zeros(3))
    return np.eye(4)


def _geometry(path: Path, link: str, shape: ElementTree.Element) -> Iterator[Float[ndarray, "t 3 3"]]:
    import trimesh

    for node in shape.findall("geometry/*"):
        try:
            if node.tag == "mesh":
                triangles, stated_m = mesh_file(_mesh_place(path, link, node.get("filename", "")))
                yield triangles * (stated_m or 1.0) * _numbers(node, "scale", 3, 1.0)
            elif node.tag == "box":
                yield np.asarray(trimesh.creation.box(_numbers(node, "size", 3, 0.0)).triangles, float)
            elif node.tag == "sphere":
                yield np.asarray(trimesh.creation.icosphere(3, _numbers(node, "radius", 1, 0.0)[0]).triangles, float)
            elif node.tag == "cylinder":
                size = _numbers(node, "radius", 1, 0.0)[0], _numbers(node, "length", 1, 0.0)[0]
                yield np.asarray(trimesh.creation.cylinder(*size).triangles, float)
        except ValueError as error:
            raise SceneError(f"{path}: link '{link}': {node.tag}: {error}") from error


def _mesh_place(path: Path, link: str, name: str) -> Path:
    url = urlparse(name)
    relative = Path(unquote(url.path).lstrip("/")) if url.scheme == "package" else Path(unquote(url.path or name))
    if url.scheme != "package":
        place = path.parent / relative
        if place.is_file():
            return place
    folders = path.resolve().parents
    places = [folder / part for folder in folders for part in (Path(url.netloc) / relative, relative)]
    for place in places if url.scheme == "package" else ():
        if place.is_file():
            return place
    raise SceneError(f"{path}: link '{link}': no mesh '{name}' next to the URDF or above it")


def _origin(node: ElementTree.Element) -> Pose:
    origin = node.find("origin")
    if origin is None:
        return np.eye(4)
    R = Rotation.from_euler("xyz", _numbers(origin, "rpy", 3, 0.0)).as_matrix()
    return frames.rigid(R, _numbers(origin, "xyz", 3, 0.0))


def _numbers(node: ElementTree.Element, key: str, count: int, default: float) -> Float[ndarray, " n"]:
    """Return the numbers of an attribute, shape (count,)."""
    values = [float(word) for word in node.get(key, " ".join([str(default)] * count)).split()]
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(f"{key} = '{node.get(key)}': allowed {count} finite numbers")
    return np.array(values)


def _end(joint: ElementTree.Element, which: str) -> str:
    end = joint.find(which)
    return "" if end is None else end.get("link", "")

"""The ray caster: meshes of a room, a robot or a scanner, and the surface that a beam hits first.

Embree (extra `scene`) finds the triangle in single precision; the range is then taken from that triangle's plane in
double precision, so that it is as exact as the mesh. Only a beam within float32 of an edge (about 1e-6 m in a room) can
be assigned to the neighbour of the triangle that it hits. Without embree an R-tree finds the triangle (`nearest`): the
same ranges and incidences except for such beams, 10 to 50 times more slowly.

Functions import trimesh, embree and rtree, since most commands never cast a ray.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int32
from numpy import ndarray
from numpy.typing import ArrayLike

from scanwright.design import frames
from scanwright.design.arrays import Array, Vector
from scanwright.design.errors import SceneError
from scanwright.design.scene.mesh_file import mesh_file
from scanwright.design.scene.nearest import Nearest, nearest_search
from scanwright.design.scene.posture import AS_IT_IS, SUFFIX, Posture

_AS_IT_IS = np.eye(4)
_BATCH = 1 << 17  # rays; bounds the memory of one cast


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Triangles, ready to be hit from either side."""

    triangles_m: Float[ndarray, "t 3 3"]  # corners, shape (t, 3, 3)
    normals: Float[ndarray, "t 3"]  # unit normals by the right-hand rule, shape (t, 3)
    origin_m: Vector  # middle of the scene, shape (3,); the search sees the scene from there, where float32 is finest
    nearest: Nearest  # finds the triangle that a ray hits first


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """The first hit of each ray; row i is ray i."""

    range_m: Float[ndarray, " n"]  # shape (n,), inf without a hit
    # angle between ray and surface normal, 0 .. pi/2, shape (n,), NaN without a hit
    incidence_rad: Float[ndarray, " n"]
    triangle: Int32[ndarray, " n"]  # row of `Scene.triangles_m` and `Scene.normals`, shape (n,), -1 without a hit


def load_scene(path: Path, unit_m: float = 1.0, T_world_mesh: ArrayLike = _AS_IT_IS) -> Scene:
    """Return the scene of one mesh file; arguments and errors as for `load_triangles`."""
    return build_scene(load_triangles(path, unit_m, T_world_mesh), str(path))


def load_triangles(
    path: Path, unit_m: float = 1.0, T_world_mesh: ArrayLike = _AS_IT_IS, posture: Posture = AS_IT_IS
) -> Float[ndarray, "t 3 3"]:
    """Return the corners of a mesh in the world [m], shape (t, 3, 3), with the axes of the file.

    Args:
        path: STL, PLY, OBJ, DAE or GLB; or a URDF, which is in metres.
        unit_m: length of one unit of the file.
        T_world_mesh: pose of the mesh [m].
        posture: of the robot of a URDF.

    Raises:
        SceneError: the file is missing, is not a mesh, has no triangle, or states another unit.
    """
    if not 0 < unit_m < np.inf:
        raise SceneError(f"{path}: unit_m = {unit_m}: the length of one unit of the file, such as 0.001 for mm")
    stated_m: float | None = 1.0
    if path.suffix.lower() == SUFFIX:
        from scanwright.design.scene.urdf import urdf_triangles

        triangles = urdf_triangles(path, posture)
    else:
        triangles, stated_m = mesh_file(path)
    if stated_m and not np.isclose(stated_m, unit_m):
        raise SceneError(f"{path}: unit_m = {unit_m:g}, but the file states that one unit is {stated_m:g} m")
    return frames.apply(np.asarray(T_world_mesh, dtype=float), triangles.reshape(-1, 3) * unit_m).reshape(-1, 3, 3)


def build_scene(triangles_m: Float[ndarray, "t 3 3"], name: str = "scene") -> Scene:
    """Return the scene of triangles, shape (t, 3, 3); `name` is its name in errors.

    Raises:
        SceneError: no triangle has an area, or a corner is not a number.
    """
    if not np.isfinite(triangles_m).all():
        bad = int((~np.isfinite(triangles_m)).any(axis=(1, 2)).sum())
        raise SceneError(f"{name}: {bad} of {len(triangles_m)} triangles have a corner that is not a finite number")
    across = np.cross(triangles_m[:, 1] - triangles_m[:, 0], triangles_m[:, 2] - triangles_m[:, 0])
    twice_area = np.linalg.norm(across, axis=1)
    solid = twice_area > 0  # a triangle without area is hit by no ray and has no normal
    if not solid.any():
        raise SceneError(f"{name}: no triangle: it is empty, a point cloud, or cut off")
    triangles = np.ascontiguousarray(triangles_m[solid])
    origin = (triangles.min(axis=(0, 1)) + triangles.max(axis=(0, 1))) / 2
    return Scene(triangles, across[solid] / twice_area[solid, None], origin, nearest_search(triangles - origin))


def cast(scene: Scene, origins_m: ArrayLike, directions: ArrayLike) -> Hits:
    """Return the nearest surface along rays from origins, shape (n, 3) or (3,), in unit directions, shape (n, 3)."""
    directions = np.asarray(directions, dtype=float)
    origins = np.broadcast_to(np.asarray(origins_m, dtype=float), directions.shape)
    hits = Hits(
        np.full(len(directions), np.inf), np.full(len(directions), np.nan), np.full(len(directions), -1, np.int32)
    )
    for start in range(0, len(directions), _BATCH):
        _cast_batch(scene, origins, directions, slice(start, start + _BATCH), hits)
    return hits


def _cast_batch(scene: Scene, origins: Array, directions: Array, rows: slice, hits: Hits) -> None:
    origin, direction = origins[rows] - scene.origin_m, directions[rows]
    triangle, roughly = scene.nearest(origin, direction)
    hit = triangle >= 0
    normal, corner = scene.normals[triangle], scene.triangles_m[triangle, 0] - scene.origin_m
    along = np.einsum("ij,ij->i", normal, direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = np.einsum("ij,ij->i", normal, corner - origin) / along
    # Seen exactly edge on, a plane gives no range: use that of the search.
    hits.range_m[rows] = np.where(hit, np.where(np.isfinite(exact), exact, roughly), np.inf)
    hits.incidence_rad[rows] = np.where(hit, np.arccos(np.minimum(np.abs(along), 1.0)), np.nan)
    hits.triangle[rows] = triangle

"""Pose of a part on the printer's bed, for print files and checks. Millimetres.

Of all poses on a larger flat, those that fit the bed; of these the least support, the volume of the columns below
overhanging faces (more than 45 deg out of the vertical); of equal ones (to a cubic centimetre) the larger contact, then
the lower pose. The smallest rectangle around the part is along the bed, or tilted if it only fits so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from scanwright.cad.geometry.mesh import TriMesh, canonical
from scanwright.design.arrays import Array
from scanwright.design.frames import rigid

OVERHANG_RAD = math.radians(45.0)
CONTACT_SHARE = 0.25  # of the largest flat on the hull: smaller ones adhere badly
FLAT = 1e-3  # mm, within which points count as one plane
PRINT_DECIMALS = 5  # of a coordinate [mm] in a print file
SUPPORT_STEP_MM3 = 1000.0  # poses closer than this print alike


@dataclass(frozen=True, slots=True)
class PrintPose:
    """One part on the bed."""

    T_bed_part: Array  # maps the part's frame to the bed's: origin in a corner of the bed, z up, shape (4, 4)
    size_mm: tuple[float, float, float]  # box of the part on the bed
    contact_mm2: float  # area that lies on the bed
    overhang_mm2: float  # area of the faces that need support
    support_mm3: float  # volume of the columns under them
    fits: bool  # whether the box fits the bed


def print_pose(mesh: TriMesh, bed_mm: tuple[float, float, float]) -> PrintPose:
    """Return the pose in which a part is printed, by the rule at the top of this module."""
    faces = _Faces(*mesh.across(), mesh.vertices[mesh.faces].sum(axis=1) / 3)
    poses = [_pose(mesh, faces, down, bed_mm) for down in _flats(mesh, faces)]

    def cost(pose: PrintPose) -> tuple[bool, float, float, float]:
        support = round(pose.support_mm3 / SUPPORT_STEP_MM3)
        return not pose.fits, support, -round(pose.contact_mm2), round(pose.size_mm[2], 2)

    return min(poses, key=cost)


def on_bed(mesh: TriMesh, pose: PrintPose) -> TriMesh:
    """Return the mesh in the frame of the bed, rounded as print files write it, with one vertex at each place.

    If that would open the surface, vertices stay apart: a slicer reads triangles by their numbers.
    """
    vertices = mesh.vertices @ pose.T_bed_part[:3, :3].T + pose.T_bed_part[:3, 3]
    vertices[:, 2] = np.where(np.abs(vertices[:, 2]) < FLAT, 0.0, vertices[:, 2])
    merged = canonical(TriMesh(vertices, mesh.faces), PRINT_DECIMALS)
    return merged if merged.is_closed() else TriMesh(np.round(vertices, PRINT_DECIMALS) + 0.0, mesh.faces)


@dataclass(frozen=True, slots=True)
class _Faces:
    """Unit normals, areas and middles of the triangles."""

    normals: Array
    areas: Array
    middles: Array


def _flats(mesh: TriMesh, faces: _Faces) -> Array:
    """Return the outward normals of the flats that lie on the convex hull, shape (n, 3), the largest first.

    A part without one, such as a ball, gets the largest facets of its hull.
    """
    hull = ConvexHull(mesh.vertices)
    corners = mesh.vertices[hull.vertices]
    contacts: list[tuple[float, Array]] = []
    for normal in _directions(faces):
        reach = float((corners @ normal).max())
        lies = (faces.normals @ normal > 1 - 1e-8) & (faces.middles @ normal > reach - FLAT)
        area = float(faces.areas[lies].sum())
        if area > 0:
            contacts.append((area, normal))
    if not contacts:
        a, b, c = (mesh.vertices[hull.simplices[:, i]] for i in range(3))
        largest = np.argsort(-np.linalg.norm(np.cross(b - a, c - a), axis=1), kind="stable")
        return hull.equations[largest[:20], :3]
    contacts.sort(key=lambda item: (-round(item[0], 1), *np.round(item[1], 6)))
    return np.array([normal for area, normal in contacts if area >= CONTACT_SHARE * contacts[0][0]])


def _directions(faces: _Faces) -> list[Array]:
    """Return mean normals of triangles with a common direction that have more than 1 % of the largest area."""
    key = np.round(faces.normals, 4) + 0.0
    _, index = np.unique(key, axis=0, return_inverse=True)
    index = index.reshape(-1)
    area = np.bincount(index, weights=faces.areas)
    sums = np.stack([np.bincount(index, weights=faces.areas * faces.normals[:, i]) for i in range(3)], axis=1)
    large = area > 0.01 * area.max()
    return list(sums[large] / np.linalg.norm(sums[large], axis=1, keepdims=True))


def _pose(mesh: TriMesh, faces: _Faces, down: Array, bed: tuple[float, float, float]) -> PrintPose:
    up = -down
    R = _turned_to_fit(mesh.vertices, _along_bed(mesh.vertices, _upright(up)), bed)
    placed = mesh.vertices @ R.T
    low, high = placed.min(axis=0), placed.max(axis=0)
    middle = np.array([bed[0] / 2, bed[1] / 2, 0.0]) - [*(low + high)[:2] / 2, low[2]]
    size = high - low
    height = faces.middles @ up - low[2]
    lean = faces.normals @ up
    contact = (lean < -1 + 1e-6) & (height < FLAT)
    over = (lean < -math.cos(OVERHANG_RAD) - 1e-9) & ~contact
    columns = faces.areas[over] * -lean[over] * height[over]
    return PrintPose(
        T_bed_part=rigid(R, middle),
        size_mm=(float(size[0]), float(size[1]), float(size[2])),
        contact_mm2=float(faces.areas[contact].sum()),
        overhang_mm2=float(faces.areas[over].sum()),
        support_mm3=float(columns.sum()),
        fits=bool((size <= np.array(bed) + FLAT).all()),
    )


def _upright(up: Array) -> Array:
    """Return a rotation that maps the direction `up` to z."""
    helper = np.eye(3)[int(np.argmin(np.abs(np.round(up, 6))))]
    x = np.cross(helper, up)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(up, x), up])


def _turned_to_fit(vertices: Array, R: Array, bed: tuple[float, float, float]) -> Array:
    """Return R if the part fits the bed so, else R turned about z until it does."""
    flat = (vertices @ R.T)[:, :2]
    outline = flat[ConvexHull(flat).vertices]
    for turn in (0.0, math.pi / 2, *np.radians(np.arange(1.0, 180.0))):
        c, s = math.cos(turn), math.sin(turn)
        if (np.ptp(outline @ np.array([[c, s], [-s, c]]), axis=0) <= np.array(bed[:2]) + FLAT).all():
            return R if turn == 0.0 else np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ R
    return R


def _along_bed(vertices: Array, R: Array) -> Array:
    """Return R turned about z so that the smallest rectangle around the part is along x, its longer side first."""
    flat = (vertices @ R.T)[:, :2]
    outline = flat[ConvexHull(flat).vertices]
    edges = np.roll(outline, -1, axis=0) - outline
    edges = edges[np.hypot(*edges.T) > 0.01]
    best: tuple[float, Array] | None = None
    for dx, dy in edges / np.hypot(*edges.T)[:, None]:
        turned = outline @ np.array([[dx, -dy], [dy, dx]])
        width, depth = np.ptp(turned, axis=0)
        area = round(float(width * depth), 2)
        if best is None or area < best[0]:
            c, s = (dx, dy) if width >= depth else (-dy, dx)
            best = area, np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    assert best is not None
    return best[1] @ R

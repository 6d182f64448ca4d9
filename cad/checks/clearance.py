"""Distance of what turns from what does not, screws included, and overlap of bodies that move together. Millimetres.

A turning body and a fixed one meet at some axis angle if and only if their images (r, z) in the half plane about
the axis overlap, and the distance of the images is the least distance over a whole turn: no stepping. The image of a
triangle is drawn by its horizontal chords, so that it is right within CHORD_MM. Bodies that move together are
intersected as solids.
"""

import math
from collections.abc import Container, Mapping

import numpy as np
import shapely

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.checks.screw_ends import screw_ends
from scanwright.cad.checks.table import CLEARANCE_MM, OVERLAP_MM3, at_least, at_most
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.design.arrays import Array
from scanwright.design.findings import Finding
from scanwright.design.scene import ray_caster

CHORD_MM = 0.01  # error of an image's edges: a fortieth of the clearance
LEVELS = (2, 4, 8, 16, 32, 64, 128, 256)
RAY = np.array([0.5377, 0.3021, math.sqrt(1 - 0.5377**2 - 0.3021**2)])  # along no edge of any part
FAR_MM = 5.0  # distances beyond it are not computed: twelve times the clearance


def clearance_checks(assembly: Assembly) -> list[Finding]:
    """Return both checks of an assembly."""
    meet = {frozenset({name, body.meets}) for name, body in assembly.bodies.items() if body.meets}
    turning, screws = assembly.turning(), screw_ends(assembly, turning=True)
    bodies = assembly.outlines() | screws | screw_ends(assembly, turning=False)
    return [turning_check(bodies, turning | screws.keys(), meet), together_check(assembly.meshes(), turning)]


def turning_check(
    meshes: Mapping[str, TriMesh], turning: Container[str], meet: Container[frozenset[str]] = frozenset()
) -> Finding:
    """Check the least distance of turning and fixed bodies over a full turn; `meet` are pairs that may touch."""
    rings = {name: _image(mesh) for name, mesh in meshes.items()}
    sides = {turns: [rings[name] for name in rings if (name in turning) == turns] for turns in (True, False)}
    boxes = {turns: shapely.total_bounds(np.concatenate([[], *side])) for turns, side in sides.items()}
    images = {name: _near(image, boxes[name not in turning]) for name, image in rings.items()}
    nearest, subject = FAR_MM, "everything that turns"
    for rotor in sorted(name for name in meshes if name in turning):
        for stator in sorted(name for name in meshes if name not in turning):
            if frozenset({stator, rotor}) in meet:
                continue
            inside = _contains(meshes[rotor], meshes[stator]) or _contains(meshes[stator], meshes[rotor])
            distance = 0.0 if inside else _distance(images[rotor], images[stator])
            if distance < nearest:
                nearest, subject = distance, f"{rotor} and {stator}"
    return at_least("clearance", nearest, CLEARANCE_MM, "mm", subject, "least distance over a full turn")


def together_check(meshes: Mapping[str, TriMesh], turning: Container[str]) -> Finding:
    """Check the overlap of bodies that move together; arguments as for `turning_check`."""
    most, subject = 0.0, "parts that move together"
    bodies = {name: mesh.manifold() for name, mesh in meshes.items()}
    names = sorted(meshes)
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            a, b = meshes[one].vertices, meshes[other].vertices
            apart = (a.min(axis=0) > b.max(axis=0)).any() or (b.min(axis=0) > a.max(axis=0)).any()
            if (one in turning) != (other in turning) or apart:
                continue
            volume = float((bodies[one] ^ bodies[other]).volume())
            if volume > most:
                most, subject = volume, f"{one} and {other}"
    return at_most("interference", most, OVERLAP_MM3, "mm3", subject, "overlap of two parts")


def _distance(one: Array, other: Array) -> float:
    """Return the least distance of two sets of shapes in the half plane, at most FAR_MM."""
    if len(one) == 0 or len(other) == 0:
        return FAR_MM
    low, high = shapely.total_bounds(one), shapely.total_bounds(other)
    gap = np.maximum(0.0, np.maximum(low[:2] - high[2:], high[:2] - low[2:]))
    if float(np.hypot(*gap)) >= FAR_MM:
        return FAR_MM
    tree = shapely.STRtree(other)
    _, distances = tree.query_nearest(one, max_distance=FAR_MM, return_distance=True, all_matches=False)
    return float(distances.min(initial=FAR_MM))


def _near(rings: Array, box: Array) -> Array:
    """Return the shapes within FAR_MM of a box (4,), repaired; repairing all of them is slow."""
    bounds = shapely.bounds(rings)
    near = ((bounds[:, :2] < box[2:] + FAR_MM) & (bounds[:, 2:] > box[:2] - FAR_MM)).all(axis=1)
    return np.asarray(shapely.make_valid(shapely.polygons(rings[near])))


def _image(mesh: TriMesh) -> Array:
    """Return outlines of shapes in the half plane that cover the surface at every axis angle, each once."""
    corners = mesh.vertices[mesh.faces]
    radius = np.hypot(corners[:, :, 0], corners[:, :, 1])
    across = np.linalg.norm(np.ptp(corners[:, :, :2], axis=1), axis=1)
    # the chord of an arc of radius r and length s is off by s^2 / 8 r; r of the nearest corner, seldom of the inside
    wanted = 1.0 + across / np.sqrt(8 * CHORD_MM * np.maximum(radius.min(axis=1) - across / 2, 0.5))
    shapes: list[Array] = []
    for few, many in zip((0, *LEVELS), LEVELS, strict=False):
        chosen = (wanted > few) & ((wanted <= many) | (many == LEVELS[-1]))
        if chosen.any():
            outlines = _outlines(corners[chosen], many)
            shapes.append(np.unique(np.round(outlines, 3).reshape(len(outlines), -1), axis=0).reshape(-1, 2 * many, 2))
    return np.concatenate([shapely.linearrings(rings) for rings in shapes])


def _outlines(corners: Array, levels: int) -> Array:
    """Return outlines (r, z) of triangles, at each level the nearest and the furthest point, shape (m, 2 levels, 2)."""
    order = np.argsort(corners[:, :, 2], axis=1, kind="stable")
    low, middle, high = (np.take_along_axis(corners, order[:, i, None, None], axis=1)[:, 0] for i in range(3))
    share = np.linspace(0.0, 1.0, levels)
    z = low[:, None, 2] + share * (high - low)[:, None, 2]
    flat = (high[:, 2] - low[:, 2]) < 1e-9
    one = low[:, None] + share[:, None] * (high - low)[:, None]  # on the long edge
    other = _on_short_edges(low, middle, high, z)
    far = np.maximum(np.hypot(one[..., 0], one[..., 1]), np.hypot(other[..., 0], other[..., 1]))
    along = other[..., :2] - one[..., :2]
    square = np.einsum("mnk,mnk->mn", along, along)
    foot = -np.einsum("mnk,mnk->mn", one[..., :2], along) / np.where(square > 0, square, 1.0)
    point = one[..., :2] + np.clip(foot, 0.0, 1.0)[..., None] * along
    near = np.hypot(point[..., 0], point[..., 1])
    if flat.any():
        near[flat], far[flat], z[flat] = _flat(corners[flat], levels)
    return np.concatenate([np.stack([near, z], axis=2), np.stack([far, z], axis=2)[:, ::-1]], axis=1)


def _on_short_edges(low: Array, middle: Array, high: Array, z: Array) -> Array:
    """Return points at heights z on the path low - middle - high."""
    below = z <= middle[:, None, 2]
    start = np.where(below[..., None], low[:, None], middle[:, None])
    end = np.where(below[..., None], middle[:, None], high[:, None])
    rise = end[..., 2] - start[..., 2]
    share = np.where(rise > 1e-12, (z - start[..., 2]) / np.where(rise > 1e-12, rise, 1.0), 0.0)
    return start + share[..., None] * (end - start)


def _flat(corners: Array, levels: int) -> tuple[Array, ...]:
    """Return near, far and z of horizontal triangles, which are lines in the half plane."""
    ends = np.roll(corners, -1, axis=1)
    along = ends[..., :2] - corners[..., :2]
    square = np.einsum("mek,mek->me", along, along)
    foot = np.clip(-np.einsum("mek,mek->me", corners[..., :2], along) / np.maximum(square, 1e-18), 0.0, 1.0)
    reach = np.linalg.norm(corners[..., :2] + foot[..., None] * along, axis=2).min(axis=1)
    cross = along[..., 0] * corners[..., 1] - along[..., 1] * corners[..., 0]
    around_axis = (cross > 0).all(axis=1) | (cross < 0).all(axis=1)
    near = np.where(around_axis, 0.0, reach)
    far = np.linalg.norm(corners[..., :2], axis=2).max(axis=1)
    return tuple(np.repeat(values[:, None], levels, axis=1) for values in (near, far, corners[:, 0, 2]))


def _contains(outer: TriMesh, inner: TriMesh) -> bool:
    """Return whether a corner of `inner` is in `outer`: the first face that a ray from it meets is seen from inside."""
    point = inner.vertices[0]
    if not ((point > outer.vertices.min(axis=0)) & (point < outer.vertices.max(axis=0))).all():
        return False
    scene = ray_caster.build_scene(outer.vertices[outer.faces] / 1000)
    (face,) = ray_caster.cast(scene, point / 1000, RAY[None]).triangle
    return bool(face >= 0 and scene.normals[face] @ RAY > 0)

"""Kernel operations of the parts. Millimetres, rotation frame.

OCC reports empty and split results as valid, so every step ends in the check of `building`.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial

import cadquery as cq
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from scanwright.cad import outlines
from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError


@contextmanager
def building(part: str, feature: str, parameter: str, value: object) -> Iterator[Callable[[cq.Shape], cq.Solid]]:
    """Yield a function that returns the one valid solid of a step of a part.

    Raises:
        BuildError: the kernel raised, or the step split the part, emptied it, or left an invalid solid; the message
            names part, feature, parameter and value.
    """
    step = f"{part}: {feature}: {parameter} = {value}"
    try:
        yield partial(_checked, step)
    except BuildError:
        raise
    except Exception as error:
        why = f"{type(error).__name__}: {error}".removesuffix(": ")
        raise BuildError(f"{step}: the CAD kernel failed ({why}); angles a degree away may avoid it") from error


def _checked(step: str, shape: cq.Shape) -> cq.Solid:
    solids = shape.Solids()
    if len(solids) != 1:
        volumes = ", ".join(f"{solid.Volume():.3g}" for solid in solids)
        raise BuildError(f"{step}: gives {len(solids)} bodies ({volumes} mm3) instead of one")
    if solids[0].Volume() <= 0:
        raise BuildError(f"{step}: gives no volume")
    if not solids[0].isValid():
        raise BuildError(f"{step}: gives an invalid solid")
    return solids[0]


def location(R: ArrayLike, t: ArrayLike = (0.0, 0.0, 0.0)) -> cq.Location:
    """Return the pose with rotation R and origin t."""
    R = np.asarray(R, dtype=float)
    plane = cq.Plane(origin=vector(t), xDir=vector(R[:, 0]), normal=vector(R[:, 2]))
    return cq.Location(plane)


def about_axis(angle: float) -> cq.Location:
    """Return the rotation by an angle [rad] about z."""
    return cq.Location(cq.Vector(0, 0, 0), cq.Vector(0, 0, 1), math.degrees(angle))


def vector(v: ArrayLike) -> cq.Vector:
    """Return a kernel vector from three numbers."""
    x, y, z = (float(c) for c in np.asarray(v, dtype=float))
    return cq.Vector(x, y, z)


def box(low: Sequence[float], high: Sequence[float]) -> cq.Solid:
    """Return the axis-parallel box between two corners."""
    x, y, z = (b - a for a, b in zip(low, high, strict=True))
    return cq.Solid.makeBox(x, y, z, pnt=vector(low))


def cylinder(radius: float, start: ArrayLike, direction: ArrayLike, length: float) -> cq.Solid:
    """Return a cylinder from `start` along `direction`."""
    return cq.Solid.makeCylinder(radius, length, vector(start), vector(direction))


def upright(radius: float, z_low: float, z_high: float, x: float = 0.0, y: float = 0.0) -> cq.Solid:
    """Return a cylinder parallel to z."""
    return cylinder(radius, (x, y, z_low), (0.0, 0.0, 1.0), z_high - z_low)


def radial(radius: float, azimuth: float, z: float, start: float = 0.0, length: float = 80.0) -> cq.Solid:
    """Return a cylinder away from the z axis, at an azimuth [rad] and a height, from a distance on."""
    out = (math.cos(azimuth), math.sin(azimuth), 0.0)
    return cylinder(radius, (start * out[0] + 0.0, start * out[1] + 0.0, z), out, length)  # no -0.0


def prism(outline: ArrayLike, z_low: float, z_high: float, radius: ArrayLike = 0.0) -> cq.Solid:
    """Return a polygon (n, 2) extruded along z, its corners rounded by a radius, or by one for each corner."""
    if not np.any(radius):
        points = [cq.Vector(float(x), float(y), z_low) for x, y in np.asarray(outline, dtype=float)]
        wire = cq.Wire.makePolygon(points, close=True)
    else:
        arcs = [[cq.Vector(x, y, z_low) for x, y in arc] for arc in outlines.rounded(outline, radius).tolist()]
        edges = []
        for (first, middle, last), (after, _, _) in zip(arcs, arcs[1:] + arcs[:1], strict=True):
            edges += [] if first == last else [cq.Edge.makeThreePointArc(first, middle, last)]
            edges.append(cq.Edge.makeLine(last, after))
        wire = cq.Wire.assembleEdges(edges)
    return cq.Solid.extrudeLinear(wire, [], cq.Vector(0, 0, z_high - z_low))


def slab(low: Sequence[float], high: Sequence[float], radius: ArrayLike) -> cq.Solid:
    """Return the box between two corners, its edges along z rounded; radii of each count from `low`, anticlockwise."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return prism([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], z0, z1, radius)


def plate(
    half_x: float,
    half_y: float,
    chamfer: float,
    z_low: float,
    z_high: float,
    radius: float = outlines.HAND,
    y: float = 0.0,
) -> cq.Solid:
    """Return a plate about (0, y): a rectangle with cut corners, all edges along z rounded."""
    return prism(outlines.octagon(half_x, half_y, chamfer, y), z_low, z_high, radius)


def slot(radius: float, first: Sequence[float], last: Sequence[float], z_low: float, z_high: float) -> cq.Shape:
    """Return a slot parallel to z between the middles (2,) of its round ends; a cylinder if they are one."""
    start, end = np.asarray(first, dtype=float), np.asarray(last, dtype=float)
    length = float(np.linalg.norm(end - start))
    if length == 0:
        return upright(radius, z_low, z_high, *start.tolist())
    aside = radius / length * np.array([start[1] - end[1], end[0] - start[0]])
    between = prism([start - aside, end - aside, end + aside, start + aside], z_low, z_high)
    return between.fuse(*(upright(radius, z_low, z_high, *middle.tolist()) for middle in (start, end)))


def lathe(profile: ArrayLike) -> cq.Solid:
    """Return a solid of revolution about z of a polygon (n, 2) of (r, z); no edge of it may lie on the axis."""
    points = [cq.Vector(float(r), 0.0, float(z)) for r, z in np.asarray(profile, dtype=float)]
    wire = cq.Wire.makePolygon(points, close=True)
    return cq.Solid.revolve(wire, [], 360.0, cq.Vector(0, 0, 0), cq.Vector(0, 0, 1))


def sector(r_low: float, r_high: float, start: float, end: float, z_low: float, z_high: float) -> cq.Solid:
    """Return a sector of a thick ring about z between two angles [rad], with chords for arcs, which cut more safely."""
    count = max(2, math.ceil((end - start) / 0.2) + 1)
    angle = np.linspace(start, end, count)
    arc = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    outer = arc * (r_high / math.cos((end - start) / (count - 1) / 2))
    return prism(np.concatenate([outer, r_low * arc[::-1]]), z_low, z_high)


def hull(points: Array) -> cq.Solid:
    """Return a convex hull of points (n, 3) with one planar face per plane of the hull."""
    points = np.unique(np.round(points, 9), axis=0)
    convex = ConvexHull(points)
    order = np.lexsort(np.round(convex.equations, 7).T)
    # triangles of one nearly flat polygon may have planes that differ a little and corners that do not: one face
    plane_of: dict[frozenset[int], Array] = {}
    for plane in convex.equations[order]:
        flat = np.abs(points @ plane[:3] + plane[3]) < 1e-6
        plane_of.setdefault(frozenset(np.flatnonzero(flat).tolist()), plane)
    faces: list[cq.Face] = []
    for on_it, plane in plane_of.items():
        if any(on_it < more for more in plane_of):
            continue
        corners = _around(points[sorted(on_it)], plane[:3])
        faces.append(cq.Face.makeFromWires(cq.Wire.makePolygon([vector(p) for p in corners], close=True)))
    solid = cq.Solid.makeSolid(cq.Shell.makeShell(faces))
    if solid.Volume() < 0:
        solid = cq.Solid(solid.wrapped.Reversed())
    return solid


def _around(corners: Array, normal: Array) -> Array:
    """Return corners of a convex polygon in order about its normal, those inside an edge dropped."""
    centre = corners.mean(axis=0)
    first = corners[0] - centre
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    flat = np.stack([(corners - centre) @ first, (corners - centre) @ second], axis=1)
    outline = ConvexHull(flat).vertices
    return corners[np.roll(outline, -int(np.argmin(outline)))]

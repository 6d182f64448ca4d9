"""Engraved label of a printed part: task, angles and configuration; FRONT where the lidar's front comes. Millimetres.

The label goes into the largest flat faces that have room for it and a wall behind it; where none has, the part goes
without. It is the last cut: drawings, screws and moving parts know nothing of it. The lettering is our own
(`cad/glyphs.py`), so no font and no licence of one is involved.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cadquery as cq
import numpy as np
import shapely  # type: ignore[import-untyped]

from cad import solids
from cad.assembly import Assembly
from cad.glyphs import STROKE, letters, text_width
from cad.holes import Piercing
from cad.mesh import Mesh, checked_mesh
from cad.remarks import shaft_is_turned
from design.errors import BuildError
from design.frames import Array
from design.scanner import Scanner

DEPTH = 0.6
HEIGHTS = (4.5, 3.6)  # of letters, the first that fits
LEADING = 1.65  # from line to line, of the height
MARGIN = 1.5  # of a face around its label
FACES = 6  # that are tried, the largest first
STEP = 2.0  # between the places that are tried on a face
LONGEST = (16, 8)  # letters of a line, the first that fits
HAIRLINE = 2e-3
DIGITS = 8  # of the configuration's hash
FRONT_INSET = 10.0  # of its middle from the edge


@dataclass(frozen=True, slots=True)
class Labelled:
    """Printed parts with their labels, their meshes, and the names of those that have no room for one."""

    parts: dict[str, cq.Solid]
    meshes: dict[str, Mesh]
    without: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Lines:
    """Lettering, its origin at the lower left corner of its last line."""

    lines: tuple[str, ...]
    height: float

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of all lines."""
        width = max(text_width(line, self.height) for line in self.lines)
        return width, self.height * (1 + LEADING * (len(self.lines) - 1))


@dataclass(frozen=True, slots=True)
class _Pose:
    """Axes of the lettering as columns, its face's normal the last, and the place of its origin."""

    axes: Array
    origin: Array

    def location(self) -> cq.Location:
        """For the kernel."""
        return solids.location(self.axes, self.origin)


@dataclass(frozen=True, slots=True)
class _Flat:
    """A planar face: `frame` has its normal as third column, the outline is in its first two."""

    frame: Array
    origin: Array
    outline: shapely.Polygon

    def pose(self, x: float, y: float, turn: Array) -> _Pose:
        """Of lettering whose axes are the columns of `turn` (2, 2), its origin at (x, y)."""
        axes = np.column_stack([self.frame[:, :2] @ turn, self.frame[:, 2]])
        return _Pose(axes, self.origin + self.frame[:, :2] @ [x, y])


FRONT = _Lines(("FRONT",), HEIGHTS[0])


def labelled_parts(scanner: Scanner, assembly: Assembly, config_hash: str) -> Labelled:
    """Engrave every printed part that has room."""
    parts: dict[str, cq.Solid] = {}
    meshes: dict[str, Mesh] = {}
    without = []
    for name, solid in assembly.made.items():
        if name == "servo_shaft" and shaft_is_turned(assembly.stack):
            continue
        texts = label_texts(scanner, name, config_hash)
        engraved = _engraved(solid, texts, _front(assembly, name), scanner.printer.min_wall_mm)
        if engraved is None:
            without.append(name)
        else:
            parts[name], meshes[name] = engraved
    return Labelled(parts, meshes, tuple(without))


def label_texts(scanner: Scanner, name: str, config_hash: str) -> list[str]:
    """What stands on a part: the task, the angles that shape it, the configuration."""
    angles = scanner.angles.angles_deg
    turning = f"L {angles.alpha_laser:g} {angles.beta_laser:g}"
    standing = f"R {angles.alpha_rot:g} {angles.beta_rot:g}"
    shaped = {"base_mount": standing, "alignment_linkage": turning, "sub_plate": turning}.get(name)
    texts = [scanner.angles.task[: max(LONGEST)], shaped, config_hash[:DIGITS]]
    return [text for text in texts if text is not None]


def _front(assembly: Assembly, name: str) -> _Pose | None:
    """Where FRONT stands on the plates that carry the lidar: its letters' feet to the middle, its heads to the V."""
    if name not in ("alignment_linkage", "sub_plate"):
        return None
    linkage, stack = assembly.linkage, assembly.stack
    height = linkage.top if name == "alignment_linkage" else linkage.seat
    turned = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    width, letter = FRONT.size
    corner = np.array([linkage.half_x - FRONT_INSET - letter / 2, width / 2, height])
    return _Pose(stack.R() @ turned, stack.R() @ corner)


def _engraved(solid: cq.Solid, texts: list[str], front: _Pose | None, wall: float) -> tuple[cq.Solid, Mesh] | None:
    """The part with its label, and its mesh; None where it has no room, or the cut spoils it."""
    piercing, flats = Piercing(solid), _flats(solid)
    for height, longest in ((height, longest) for longest in LONGEST for height in HEIGHTS):
        label = _Lines(tuple(text[i : i + longest] for text in texts for i in range(0, len(text), longest)), height)
        pose = next(_places(flats, label.size, piercing, wall, front), None)
        if pose is None:
            continue
        cuts = _grooves(label, pose) + ([] if front is None else _grooves(FRONT, front))
        try:
            with solids.building("label", "lettering", "lines", label.lines):
                cut = solids.checked(solid.cut(*cuts), "label", "lettering", "lines", label.lines)
                return cut, checked_mesh(cut, "label")
        except BuildError:  # a part without its label is better than none
            return None
    return None


def _places(
    flats: list[_Flat], size: tuple[float, float], piercing: Piercing, wall: float, front: _Pose | None
) -> Iterator[_Pose]:
    """Poses of the label, on the largest face first, there nearest to its middle, lengthwise before upright."""
    for flat in flats:
        room = flat.outline
        if front is not None:
            width, height = FRONT.size
            corners = front.origin + np.array([[0, 0], [width, 0], [width, height], [0, height]]) @ front.axes[:, :2].T
            room = room.difference(shapely.Polygon((corners - flat.origin) @ flat.frame[:, :2]))
        room = room.buffer(-MARGIN - STROKE / 2, join_style="mitre")
        for turn in (np.eye(2), np.array([[0.0, -1.0], [1.0, 0.0]])):
            for x, y in _corners(room, size, turn):
                if _thick(flat, x, y, size, turn, piercing, wall):
                    yield flat.pose(x, y, turn)


def _corners(room: shapely.Polygon, size: tuple[float, float], turn: Array) -> list[tuple[float, float]]:
    """Lower left corners of boxes that lie in a polygon, the nearest to its middle first."""
    if room.is_empty:
        return []
    x0, y0, x1, y1 = room.bounds
    box = np.array([[0, 0], [size[0], 0], size, [0, size[1]]]) @ turn.T
    low, high = box.min(axis=0), box.max(axis=0)
    xs, ys = np.arange(x0 - low[0], x1 - high[0] + 1e-9, STEP), np.arange(y0 - low[1], y1 - high[1] + 1e-9, STEP)
    corners = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=2).reshape(-1, 2)
    if len(corners) == 0:
        return []
    shapely.prepare(room)
    fits = shapely.contains(room, shapely.polygons(corners[:, None] + box))
    middle = np.array(room.centroid.coords[0])
    away = np.round(np.linalg.norm(corners + box.mean(axis=0) - middle, axis=1), 3)
    order = np.lexsort((*corners.T, away))
    return [(float(x), float(y)) for x, y in corners[order][fits[order]][:5]]


def _thick(
    flat: _Flat, x: float, y: float, size: tuple[float, float], turn: Array, piercing: Piercing, wall: float
) -> bool:
    """Whether a wall stays behind the grooves, at points all over the label."""
    into = -flat.frame[:, 2]
    for u in np.linspace(0.0, size[0], 6):
        for v in np.linspace(0.0, size[1], 4):
            at = flat.origin + flat.frame[:, :2] @ (np.array([x, y]) + turn @ [u, v])
            if piercing.between(at + 0.05 * into, at + (DEPTH + wall) * into):
                return False
    return True


def _flats(solid: cq.Solid) -> list[_Flat]:
    """The largest planar faces."""
    faces = [face for face in solid.Faces() if face.geomType() == "PLANE"]
    places = [(-round(face.Area(), 1), *np.round(face.Center().toTuple(), 3)) for face in faces]
    flats = []
    for i in sorted(range(len(faces)), key=places.__getitem__)[:FACES]:
        face = faces[i]
        normal = np.array(face.normalAt().toTuple())
        helper = np.eye(3)[int(np.argmin(np.abs(np.round(normal, 6))))]
        along = np.cross(helper, normal) / np.linalg.norm(np.cross(helper, normal))
        frame = np.column_stack([along, np.cross(normal, along), normal])
        origin = np.array(face.Center().toTuple())
        points, triangles = face.copy().tessellate(0.05, 0.3)
        flat = (np.array([p.toTuple() for p in points]) - origin) @ frame[:, :2]
        pieces = shapely.polygons(flat[np.array(triangles)])
        # closed over the hairlines between triangles
        outline = shapely.union_all(pieces[shapely.area(pieces) > 1e-6], grid_size=1e-4).buffer(HAIRLINE)
        flats.append(_along_edge(_Flat(frame, origin, max(shapely.get_parts(outline), key=shapely.area))))
    return flats


def _along_edge(flat: _Flat) -> _Flat:
    """The same face with its first axis along its longest straight edge."""
    corners = np.asarray(shapely.simplify(flat.outline.exterior, 5 * HAIRLINE).coords)
    edges = np.round(np.diff(corners, axis=0), 2)
    along = edges[int(np.argmax(np.round(np.linalg.norm(edges, axis=1), 1)))]
    x, y = along / np.linalg.norm(along) * (1 if tuple(along) > (0, 0) else -1)
    turn = np.array([[x, -y], [y, x]])
    outline = shapely.transform(flat.outline, lambda points: points @ turn)
    return _Flat(np.column_stack([flat.frame[:, :2] @ turn, flat.frame[:, 2]]), flat.origin, outline)


def _grooves(label: _Lines, pose: _Pose) -> list[cq.Shape]:
    """What to cut: one prism per run of strokes that meet."""
    cuts: list[cq.Shape] = []
    for i, line in enumerate(reversed(label.lines)):
        up = np.array([0.0, LEADING * label.height * i])
        for part in letters(line, label.height):
            wires = [_wire(np.asarray(ring.coords)[:-1] + up) for ring in (part.exterior, *part.interiors)]
            prism = cq.Solid.extrudeLinear(wires[0], wires[1:], cq.Vector(0, 0, DEPTH + 0.5))
            cuts.append(prism.moved(pose.location()))
    return cuts


def _wire(points: Array) -> cq.Wire:
    return cq.Wire.makePolygon([cq.Vector(float(x), float(y), -DEPTH) for x, y in points], close=True)

"""Engraved label of a printed part: task, angles and configuration; FRONT where the lidar's front comes. Millimetres.

The label goes where it can be read on the assembled scanner: into the largest flat face that nothing lies on or stands
before, with room for it and a wall behind it, its lines as level as the face allows. A part with little room gets the
configuration alone; where no face can be read, a hidden one that mates with nothing takes the label, and where there
is none either, the part goes without. The label is the last cut: drawings, screws and moving parts know nothing of it.
The lettering is our own (`cad/labels/glyphs.py`), so no font and no licence of one is involved.

No flat named beside each part: on the best that a linkage has, the plate's underside, 13 of 16 random settings have
room in sight, the search finds it on all 16.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product

import cadquery as cq
import numpy as np
import shapely
from numpy.typing import NDArray

from scanwright.cad import solids
from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.geometry.holes import Piercing
from scanwright.cad.geometry.mesh import TriMesh, checked_mesh
from scanwright.cad.labels.engrave import Groove, engrave, groove_of
from scanwright.cad.labels.flats import Flat, flat_at, flats_of
from scanwright.cad.labels.lettering import Lettering, Place
from scanwright.cad.labels.visibility import Visibility
from scanwright.cad.parts.part_spec import PartSpec
from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError
from scanwright.design.findings import Finding
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

HEIGHTS = (4.5, 3.6)  # of letters, the first that fits
MARGIN = 1.5  # of a face around its label
HOLE_MARGIN = 3.0  # around a hole: the head of a screw may come there
FACES = 12  # that are tried, the largest first
LEAST_MM2 = 200.0  # of a face: the configuration alone takes more
STEP = 2.0  # between the places that are tried on a face, and the points that an eye looks for
OVERLAP = 0.01  # of the squares around these points
PLACES = 5  # of these, the nearest to its middle, that are looked at closely
LONGEST = (16, 8)  # letters of a line, the first that fits
DIGITS = 8  # of the configuration's hash
FRONT_INSET = 10.0  # of its middle from the edge
TURNS = tuple(np.array([[c, -s], [s, c]], dtype=float) for c, s in ((1, 0), (-1, 0), (0, 1), (0, -1)))


@dataclass(slots=True)
class Labelled:
    """What came of the labels of one scanner.

    Attributes:
        parts: with their labels, by name.
        meshes: of these.
        findings: labels that cannot be read on the assembled scanner.
        left_out: labels for which there was no room.
    """

    parts: dict[str, cq.Solid] = field(default_factory=dict)
    meshes: dict[str, TriMesh] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Label:
    """Lettering, its place, and whether it can be read on the assembled scanner."""

    place: Place
    lines: Lettering
    seen: bool


Views = Callable[[Flat, Array], NDArray[np.bool_]]
Room = tuple[Flat, shapely.Polygon]
FRONT = Lettering(("FRONT",), HEIGHTS[0])


@dataclass(frozen=True, slots=True)
class Ground:
    """A part that takes a label.

    Attributes:
        flats: faces that it may go to, the largest first.
        piercing: of the part.
        groove: of the lettering.
        wall: that stays behind it.
        up: direction in the rotation frame that is up as the scanner stands.
        front: where FRONT stands, if it does.
    """

    flats: Sequence[Flat]
    piercing: Piercing
    groove: Groove
    wall: float
    up: Array
    front: Place | None

    def room(self, flat: Flat) -> shapely.Polygon:
        """What of a face the middle lines of strokes may take."""
        half = self.groove.width / 2
        occupied = [shapely.Polygon(hole).buffer(HOLE_MARGIN + half) for hole in flat.outline.interiors]
        if self.front is not None and flat.face.isSame(self.front.flat.face):
            width, height = FRONT.size
            corners = self.front.put(np.array([[0, 0], [width, 0], [width, height], [0, height]]))
            word = shapely.Polygon(flat.along(self.front.flat.at(corners)))
            occupied.append(word.buffer(MARGIN + 2 * half, join_style="mitre"))
        outline = shapely.Polygon(flat.outline.exterior)
        return outline.buffer(-MARGIN - half, join_style="mitre").difference(shapely.union_all(occupied))

    def turns(self, flat: Flat) -> list[Array]:
        """Circuits to turn lettering on a face: the more upright first, of equal ones lengthwise."""
        return sorted(TURNS, key=lambda turn: -self.upright(flat, turn))

    def upright(self, flat: Flat, turn: Array) -> float:
        """How far the heads of lettering on a face point up: 1 upright, 0 sideways or lying."""
        return round(float(flat.frame[:, :2] @ turn[:, 1] @ self.up), 1)

    def faced(self, place: Place, size: tuple[float, float]) -> Place:
        """The same place for lettering of a size; where it is not upright, its heads to the middle of the face.

        So it is read from the edge that it is near to, by somebody who looks at the scanner.
        """
        centre = place.put(np.array([size]) / 2)[0]
        if self.upright(place.flat, place.turn) != 0 or float(place.turn[:, 1] @ centre) <= 0:
            return place
        x, y = place.put(np.array([size]))[0]
        return Place(place.flat, float(x), float(y), -place.turn)

    def is_thick(self, flat: Flat, points: Array) -> bool:
        """Whether a wall stays behind grooves, at points of a face."""
        into = -flat.frame[:, 2]
        deep = (self.groove.depth + self.wall) * into
        return not any(self.piercing.between(start + 0.05 * into, start + deep) for start in flat.at(points))


def labelled_parts(scanner: Scanner, assembly: Assembly, config_hash: str) -> Labelled:
    """Engrave every printed part that has room."""
    visibility, done = Visibility(assembly), Labelled()
    groove, up = groove_of(scanner.printer), scanner.angles.T_world_rot(0.0)[2, :3]
    for name, solid in assembly.made.items():
        part = assembly.parts[name]
        if part.metal:
            continue
        front = None
        if part.seat is not None:
            front = _front(assembly, solid, part.seat, groove)
            if front is None:
                why = "a hole of the seat is in the way of the word; the V in the edge says it too"
                done.left_out.append(LeftOut(f"FRONT on {name}", why, 1, "labels"))
        flats = [flat for flat in flats_of(solid, FACES, LEAST_MM2) if not visibility.touched(flat)]
        ground = Ground(flats, Piercing(solid), groove, scanner.printer.min_wall_mm, up, front)
        views = partial(visibility.views, turning=part.turns)
        label = label_on(ground, label_texts(scanner, part, config_hash), views)
        if label is None:
            why = "none of its flat faces that mate with nothing has room for one"
            done.left_out.append(LeftOut(f"label of {name}", why, 1, "labels"))
        elif not label.seen:
            message = f"{name}: its label is hidden on the assembled scanner: no face in sight has room for it"
            done.findings.append(Finding("label_hidden", "note", name, message))
        words = [] if front is None else [(front, FRONT)]
        words += [] if label is None else [(label.place, label.lines)]
        if words:
            try:
                done.parts[name], done.meshes[name] = engraved(solid, words, groove)
            except BuildError as error:  # a part without its label is better than none
                done.left_out.append(LeftOut(f"label of {name}", str(error), 1, "labels"))
    return done


def label_texts(scanner: Scanner, part: PartSpec, config_hash: str) -> list[str]:
    """What stands on a part: the task, the angles that shape it, the configuration."""
    angles = scanner.angles.angles_deg
    shaped = {
        "none": [],
        "laser": [f"L {angles.alpha_laser:g} {angles.beta_laser:g}"],
        "rot": [f"R {angles.alpha_rot:g} {angles.beta_rot:g}"],
    }[part.angles]
    return [scanner.angles.task[: max(LONGEST)], *shaped, config_hash[:DIGITS]]


def label_on(ground: Ground, texts: list[str], views: Views) -> Label | None:
    """Where a label goes, and how its texts are broken into lines; None where nothing has room.

    Args:
        ground: the part.
        texts: of the label; where they do not fit, the last one alone.
        views: which points of a face an eye before it sees, a row for each position of what turns.
    """
    rooms = [(flat, ground.room(flat)) for flat in ground.flats]
    visible_rooms = [(flat, part) for flat, room in rooms for part in _visible_parts(flat, room, views)]
    for seen, some, longest, height in product((True, False), (texts, texts[-1:]), LONGEST, HEIGHTS):
        lines = Lettering(tuple(text[i : i + longest] for text in some for i in range(0, len(text), longest)), height)
        for place in _places(ground, visible_rooms if seen else rooms, lines.size):
            points = place.put(_grid(lines.size))
            reads = not seen or bool(views(place.flat, points).all(axis=1).any())
            if reads and ground.is_thick(place.flat, points):
                return Label(place, lines, seen)
    return None


def engraved(solid: cq.Solid, words: Sequence[tuple[Place, Lettering]], groove: Groove) -> tuple[cq.Solid, TriMesh]:
    """The part with lettering, and its mesh.

    Raises:
        BuildError: the grooves spoil the part.
    """
    grooves = [(place.flat, place.outlines(lines, groove.width)) for place, lines in words]
    with solids.building("label", "lettering", "lines", [lines.lines for _, lines in words]) as checked:
        cut = checked(engrave(solid, grooves, groove.depth))
    return cut, checked_mesh(cut, "label")


def _front(assembly: Assembly, solid: cq.Solid, height: float, groove: Groove) -> Place | None:
    """Where FRONT stands on the plates that carry the lidar: its letters' feet to the middle, its heads to the V."""
    R = assembly.layout.stack.R()
    width, letter = FRONT.size
    middle = assembly.layout.linkage.half_x - FRONT_INSET
    flat = flat_at(solid, R @ [middle, 0.0, height], R[:, 2])
    if flat is None:
        return None
    x, y = flat.along((R @ [middle - letter / 2, width / 2, height])[None])[0]
    turn = flat.frame[:, :2].T @ R[:, :2] @ [[0.0, 1.0], [-1.0, 0.0]]
    place = Place(flat, float(x), float(y), turn)
    word = shapely.MultiPolygon(place.outlines(FRONT, groove.width))
    return place if flat.outline.contains(word) else None


def _visible_parts(flat: Flat, room: shapely.Polygon, views: Views) -> list[shapely.Polygon]:
    """What of a room an eye sees, to squares of STEP, for each position of what turns: the largest first."""
    x0, y0, x1, y1 = flat.outline.bounds
    xs, ys = np.arange(x0 + STEP / 2, x1 + STEP / 2, STEP), np.arange(y0 + STEP / 2, y1 + STEP / 2, STEP)
    points = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=2).reshape(-1, 2)
    points = points[shapely.contains_xy(flat.outline, points[:, 0], points[:, 1])]
    visible = []
    for seen in np.unique(views(flat, points), axis=0):
        low, high = points[seen] - STEP / 2 - OVERLAP, points[seen] + STEP / 2 + OVERLAP
        visible.append(room if seen.all() else room.intersection(shapely.union_all(shapely.box(*low.T, *high.T))))
    return sorted(visible, key=lambda part: -round(part.area, 1))


def _places(ground: Ground, rooms: Sequence[Room], size: tuple[float, float]) -> Iterator[Place]:
    """Of lettering of a size: in the first room first, the more upright way first, there nearest to its middle."""
    for flat, room in rooms:
        for turn in ground.turns(flat):
            for x, y in _corners(room, size, turn):
                yield ground.faced(Place(flat, x, y, turn), size)


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
    return [(float(x), float(y)) for x, y in corners[order][fits[order]][:PLACES]]


def _grid(size: tuple[float, float]) -> Array:
    """Points all over lettering of a size, shape (n, 2)."""
    u, v = np.meshgrid(np.linspace(0.0, size[0], 6), np.linspace(0.0, size[1], 4), indexing="ij")
    return np.column_stack([u.ravel(), v.ravel()])

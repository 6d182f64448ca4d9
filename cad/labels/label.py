"""Engraved label of a printed part: task, angles and configuration; FRONT at the lidar's front. Millimetres.

The label is in STL, 3MF and GLB, not in STEP; drawings, screws and checks use the part without it. It is on the largest
flat face with enough area and a wall behind it, preferably one that can be read on the assembled scanner, else one that
touches nothing there. A small part gets the configuration alone or no label.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product

import cadquery as cq
import numpy as np
import shapely

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.geometry.holes import Piercing
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.labels.engrave import Flat, Groove, engrave, flat_at, flats_of, groove_of
from scanwright.cad.labels.lettering import Lettering, Place
from scanwright.cad.parts.part_spec import PartSpec
from scanwright.design.arrays import Array
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner
from scanwright.design.scene import ray_caster

HEIGHTS = (4.5, 3.6)  # of letters, the first that fits
MARGIN = 1.5  # of a face around its label
HOLE_MARGIN = 3.0  # around a hole: for the head of a screw
FACES = 12  # to try, the largest first
LEAST_MM2 = 200.0  # of a face: the configuration alone needs more
READING = 200.0  # in front of a face, to read it
TOUCH = 1.0  # in front of a face: a nearer body touches it
STEP = 2.0  # between tried places on a face, and between points of measured distance
OVERLAP = 0.01  # of the squares around these points
PLACES = 5  # of these, the nearest to its middle, with a measured wall
LONGEST = (16, 8)  # letters of a line, the first that fits
DIGITS = 8  # of the configuration's hash
FRONT_INSET = 10.0  # of its middle from the edge
TURNS = tuple(np.array([[c, -s], [s, c]], dtype=float) for c, s in ((1, 0), (0, 1)))  # lengthwise first
OFF = 0.05  # from the face to the start of the rays
DECK_HALF = 2000.0
DECK_BELOW = 0.2  # of its face in this scene: a foot that lies on it then touches it

FreeDistance = Callable[[Flat, Array], Array]
"""Distances from points of a face, shape (n, 2), to the next body: shape (n,), 0 if it touches, inf if none."""


def free_distance(assembly: Assembly) -> FreeDistance:
    """Return a measurement by rays against all bodies of the assembly and its deck."""
    corners = [mesh.vertices[mesh.faces] for mesh in assembly.meshes().values()]
    bodies = ray_caster.build_scene(np.concatenate([_deck(assembly), *corners]) / 1000)

    def measured(flat: Flat, points: Array) -> Array:
        normal = flat.frame[:, 2]
        starts = (flat.at(points) + OFF * normal) / 1000
        hits = ray_caster.cast(bodies, starts, np.broadcast_to(normal, starts.shape))
        # a body on the face contains the start of the ray, which then meets its surface from within
        within = (hits.triangle >= 0) & (bodies.normals[hits.triangle] @ normal > 0)
        return np.asarray(1000 * np.where(within, 0.0, hits.range_m))

    return measured


def _deck(assembly: Assembly) -> Array:
    """Return the deck as two triangles, shape (2, 3, 3)."""
    axes, centre = assembly.layout.deck.rotation(), np.array(assembly.layout.deck.centre)
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * DECK_HALF
    corners = centre - DECK_BELOW * axes[:, 2] + square @ axes[:, :2].T
    return corners[[[0, 1, 2], [0, 2, 3]]]


@dataclass(slots=True)
class Labelled:
    """The labels of one scanner."""

    meshes: dict[str, TriMesh] = field(default_factory=dict)  # with their labels, by part
    left_out: list[LeftOut] = field(default_factory=list)  # labels that did not fit


FRONT = Lettering(("FRONT",), HEIGHTS[0])


@dataclass(frozen=True, slots=True)
class Ground:
    """A part to label."""

    flats: Sequence[Flat]  # possible faces, the largest first
    piercing: Piercing  # of the part
    groove: Groove  # of the lettering
    wall: float  # least wall behind it
    front: Place | None  # place of the word FRONT, if the part has it

    def area(self, flat: Flat) -> shapely.Polygon:
        """Return the part of a face that the middle lines of strokes may use."""
        half = self.groove.width / 2
        occupied = [shapely.Polygon(hole).buffer(HOLE_MARGIN + half) for hole in flat.outline.interiors]
        if self.front is not None and flat.face.isSame(self.front.flat.face):
            width, height = FRONT.size
            corners = self.front.put(np.array([[0, 0], [width, 0], [width, height], [0, height]]))
            word = shapely.Polygon(flat.along(self.front.flat.at(corners)))
            occupied.append(word.buffer(MARGIN + 2 * half, join_style="mitre"))
        outline = shapely.Polygon(flat.outline.exterior)
        return outline.buffer(-MARGIN - half, join_style="mitre").difference(shapely.union_all(occupied))

    def is_thick(self, flat: Flat, points: Array) -> bool:
        """Return whether a wall remains behind grooves at points of a face."""
        into = -flat.frame[:, 2]
        deep = (self.groove.depth + self.wall) * into
        return not any(self.piercing.between(start + 0.05 * into, start + deep) for start in flat.at(points))


def labelled_parts(assembly: Assembly) -> Labelled:
    """Engrave every printed part that has enough area."""
    layout, before, done = assembly.layout, free_distance(assembly), Labelled()
    scanner, groove = layout.scanner, groove_of(layout.scanner.printer)
    for name, solid in assembly.made.items():
        part = assembly.parts[name]
        if part.metal:
            continue
        front = None
        if part.seat is not None:
            front = _front(assembly, solid, part.seat, groove)
            if front is None:
                why = "a hole of the seat is in its place; the V in the edge also marks the front"
                done.left_out.append(LeftOut(f"FRONT on {name}", why, 1, "labels"))
        ground = Ground(flats_of(solid, FACES, LEAST_MM2), Piercing(solid), groove, scanner.printer.min_wall_mm, front)
        label = label_on(ground, label_texts(scanner, part, layout.digest), before)
        if label is None:
            why = "no free flat face is large enough"
            done.left_out.append(LeftOut(f"label of {name}", why, 1, "labels"))
        words = [] if front is None else [(front, FRONT)]
        words += [] if label is None else [label]
        if words:
            try:
                done.meshes[name] = engraved(assembly.mesh(name), words, groove, name)
            except BuildError as error:  # a part without its label is better than none
                done.left_out.append(LeftOut(f"label of {name}", str(error), 1, "labels"))
    return done


def label_texts(scanner: Scanner, part: PartSpec, config_hash: str) -> list[str]:
    """Return lines of the label of a part: the task, the angles that shape it, the configuration."""
    angles = scanner.angles.angles_deg
    shaped = {
        "none": [],
        "laser": [f"L {angles.alpha_laser:g} {angles.beta_laser:g}"],
        "rot": [f"R {angles.alpha_rot:g} {angles.beta_rot:g}"],
    }[part.angles]
    return [scanner.angles.task[: max(LONGEST)], *shaped, config_hash[:DIGITS]]


def label_on(ground: Ground, texts: list[str], before: FreeDistance) -> tuple[Place, Lettering] | None:
    """Return place and lines of a label, of the last text alone if all do not fit; None if no face has enough area."""
    for least in (READING, TOUCH):
        areas = [(flat, _open(flat, ground.area(flat), before, least)) for flat in ground.flats]
        for some, longest, height in product((texts, texts[-1:]), LONGEST, HEIGHTS):
            split = tuple(text[i : i + longest] for text in some for i in range(0, len(text), longest))
            lines = Lettering(split, height)
            for place in _places(areas, lines.size):
                if ground.is_thick(place.flat, place.put(_grid(lines.size))):
                    return place, lines
    return None


def engraved(mesh: TriMesh, words: Sequence[tuple[Place, Lettering]], groove: Groove, part: str) -> TriMesh:
    """Return the mesh of a part with lettering; errors are those of `engrave`."""
    return engrave(
        mesh, [(place.flat, place.outlines(lines, groove.width)) for place, lines in words], groove.depth, part
    )


def _front(assembly: Assembly, solid: cq.Solid, height: float, groove: Groove) -> Place | None:
    """Return the place of FRONT on the plates that carry the lidar, its letters upright towards the V."""
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


def _open(flat: Flat, area: shapely.Polygon, before: FreeDistance, least: float) -> shapely.Polygon:
    """Return the part of an area, in squares of STEP, in front of which no body is nearer than `least`."""
    x0, y0, x1, y1 = flat.outline.bounds
    xs, ys = np.arange(x0 + STEP / 2, x1 + STEP / 2, STEP), np.arange(y0 + STEP / 2, y1 + STEP / 2, STEP)
    points = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=2).reshape(-1, 2)
    points = points[shapely.contains_xy(flat.outline, points[:, 0], points[:, 1])]
    points = points[before(flat, points) > least]
    low, high = points - STEP / 2 - OVERLAP, points + STEP / 2 + OVERLAP
    return area.intersection(shapely.union_all(shapely.box(*low.T, *high.T)))


def _places(areas: Sequence[tuple[Flat, shapely.Polygon]], size: tuple[float, float]) -> Iterator[Place]:
    """Return places of lettering of a size: in the first area first, there nearest to its middle."""
    for flat, area in areas:
        for turn in TURNS:
            for x, y in _corners(area, size, turn):
                yield Place(flat, x, y, turn)


def _corners(area: shapely.Polygon, size: tuple[float, float], turn: Array) -> list[tuple[float, float]]:
    """Return the lower left corners of boxes inside a polygon, the nearest to its middle first."""
    if area.is_empty:
        return []
    x0, y0, x1, y1 = area.bounds
    box = np.array([[0, 0], [size[0], 0], size, [0, size[1]]]) @ turn.T
    low, high = box.min(axis=0), box.max(axis=0)
    xs, ys = np.arange(x0 - low[0], x1 - high[0] + 1e-9, STEP), np.arange(y0 - low[1], y1 - high[1] + 1e-9, STEP)
    corners = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=2).reshape(-1, 2)
    if len(corners) == 0:
        return []
    shapely.prepare(area)
    fits = shapely.contains(area, shapely.polygons(corners[:, None] + box))
    middle = np.array(area.centroid.coords[0])
    away = np.round(np.linalg.norm(corners + box.mean(axis=0) - middle, axis=1), 3)
    order = np.lexsort((*corners.T, away))
    return [(float(x), float(y)) for x, y in corners[order][fits[order]][:PLACES]]


def _grid(size: tuple[float, float]) -> Array:
    """Return points all over lettering of a size, shape (n, 2)."""
    u, v = np.meshgrid(np.linspace(0.0, size[0], 6), np.linspace(0.0, size[1], 4), indexing="ij")
    return np.column_stack([u.ravel(), v.ravel()])

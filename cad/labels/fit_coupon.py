"""Plates to print first: the fit coupon, in half an hour, and the test plate, the holes of lidar and servo.

Frame: its own, mm, on the bed. A row of bores for the spigot of a turned shaft, one of holes for each screw of the
devices, one of nut pockets if the profile uses nuts. The text above a row names it and the clearance on the diameter of
its first hole; each further hole has 0.1 mm more (`M3 .2+`: 0.2, 0.3, 0.4 ...). Write the clearance of the bore that
slides without backlash, and of the hole that the screw just falls through, into the profile (`fit_clearance_mm`,
`screw_clearance_mm`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cadquery as cq
import numpy as np
import shapely

from scanwright.cad import outlines, solids
from scanwright.cad.geometry.mesh import TriMesh, checked_mesh
from scanwright.cad.labels.engrave import Flat, engrave, flat_at, groove_of
from scanwright.cad.labels.lettering import letters, text_width
from scanwright.cad.layout.hub import Hub
from scanwright.cad.layout.joints import ScrewPattern
from scanwright.cad.layout.names import FIT_COUPON, LIDAR_BODY, SERVO_CASE, SERVO_HORN, SERVO_OUTPUT, TEST_PLATE
from scanwright.cad.screws import SCREWS, passing_hole, trap_of
from scanwright.cad.solids import building
from scanwright.design.arrays import Array
from scanwright.design.scanner import Scanner

NUT = SCREWS["M3"]  # that the parts trap
THICKNESS = 1.8  # least: the height that a fit is tried over
FLOOR = 1.0  # below pockets
LETTER = 4.5
STEP = 0.1  # from one clearance to the next
COLUMNS = 5
WALL = 1.6  # between holes, and around all
POCKETS = "NUT"  # heading of the row for nuts
THICKNESS_MM = 1.2
EDGE_MM = 5.0  # around the axes of outer holes, and inside
OVERLAP_MM = 1.0  # of two frames
LEAST_MM2 = 60.0  # of an open middle
PLAY_MM = 0.6  # on the diameter of the horn's boss


@dataclass(frozen=True, slots=True)
class _Row:
    """Holes of one nominal diameter, from left to right by their clearances, below their words."""

    name: str
    nominal: float
    fits: list[float]

    @property
    def words(self) -> str:
        return f"{self.name} {f'{self.fits[0]:.2f}'.removeprefix('0').removesuffix('0')}+"

    @property
    def pitch(self) -> float:
        across = self.nominal + self.fits[-1]
        return WALL + (across * 2 / math.sqrt(3) if self.name == POCKETS else across)

    @property
    def width(self) -> float:
        return 2 * WALL + max(COLUMNS * self.pitch - WALL, text_width(self.words, LETTER))

    @property
    def height(self) -> float:
        return self.pitch + LETTER + WALL


def fit_coupon(scanner: Scanner, stack: Hub) -> TriMesh:
    """Return the mesh of the coupon of one scanner's printer."""
    rows, plate, groove = _rows(scanner, stack), coupon_plate(scanner, stack), groove_of(scanner.printer)
    height = plate.BoundingBox().zmax
    top = flat_at(plate, np.array([0.5, 0.5, height]), np.array([0.0, 0.0, 1.0]))
    assert top is not None
    grooves = []
    for row, (left, _, high) in zip(rows, _laid_out(rows)[2], strict=True):
        grooves += _letters(row.words, np.array([left, high, height]), groove.width, top)
    return engrave(checked_mesh(plate, FIT_COUPON), [(top, grooves)], groove.depth, FIT_COUPON)


def coupon_plate(scanner: Scanner, stack: Hub) -> cq.Solid:
    """Make the coupon without its words."""
    printer, rows = scanner.printer, _rows(scanner, stack)
    trap = trap_of(NUT, printer)
    thickness = max(THICKNESS, 0.0 if trap is None else trap.depth + FLOOR)
    width, depth, places = _laid_out(rows)
    holes: list[cq.Solid] = []
    for row, (left, low, _) in zip(rows, places, strict=True):
        for i, fit in enumerate(row.fits):
            x, y = left + row.pitch * (i + 0.5) - WALL / 2, low + (row.pitch - WALL) / 2
            bore = row.nominal + fit
            if row.name == POCKETS and trap is not None:
                pocket = outlines.polygon(bore / math.sqrt(3), 6) + np.array([x, y])
                holes.append(solids.prism(pocket, thickness - trap.depth, thickness + 1.0))
                bore = trap.hole
            holes.append(solids.upright(bore / 2, -1.0, thickness + 1.0, x, y))
    with building(FIT_COUPON, "plate and holes", "rows", len(rows)) as checked:
        return checked(solids.box((0.0, 0.0, 0.0), (width, depth, thickness)).cut(*holes))


def _laid_out(rows: list[_Row]) -> tuple[float, float, list[tuple[float, float, float]]]:
    """Return the width and depth of the plate; left of each row, low of its holes and of its words.

    Rows are next to each other within the width of the widest.
    """
    widest = max(row.width for row in rows)
    lines: list[list[_Row]] = []
    for row in rows:
        if lines and sum(other.width for other in [*lines[-1], row]) <= widest:
            lines[-1].append(row)
        else:
            lines.append([row])
    depth = WALL + sum(max(row.height for row in line) for line in lines)
    places, top = [], depth - WALL
    for line in lines:
        low = top - max(row.height for row in line) + WALL
        left = WALL
        for row in line:
            places.append((left, low, top - LETTER))
            left += row.width
        top = low - WALL
    return widest, depth, places


def _rows(scanner: Scanner, stack: Hub) -> list[_Row]:
    """Return the rows: spigots first if the shaft is turned, nut pockets last if the profile uses nuts."""
    printer = scanner.printer
    fits, screws = _around(printer.fit_clearance_mm), _around(printer.screw_clearance_mm)
    # a cup is printed too, and the screws clamp it: bores as wide as that would take an hour to print
    rows = [] if stack.cup_bore > 0 else [_Row(f"{stack.shaft_diameter:g}", stack.shaft_diameter, fits)]
    for name in sorted({scanner.servo.front.screw, *(held.screw for held in scanner.lidar.held.values())}):
        rows.append(_Row(name, SCREWS[name].nominal, screws))
    return rows if trap_of(NUT, printer) is None else [*rows, _Row(POCKETS, NUT.nut_across, fits)]


def _letters(text: str, corner: Array, stroke: float, top: Flat) -> list[shapely.Polygon]:
    """Return outlines of words from their lower left corner, in the axes of the upper face."""

    def put(points: Array) -> Array:
        return top.along(corner + np.column_stack([points, np.zeros(len(points))]))

    return [shapely.transform(outline, put) for outline in letters(text, LETTER, stroke)]


def _around(clearance: float) -> list[float]:
    """Return clearances about that of the profile, none below 0."""
    below = min(COLUMNS // 2, int(clearance / STEP + 1e-9))
    return [round(clearance + (i - below) * STEP, 3) for i in range(COLUMNS)]


def make_test_plate(scanner: Scanner, patterns: Sequence[ScrewPattern]) -> cq.Solid | None:
    """Make the plate of one scanner; None if nothing is screwed to its lidar or servo."""
    frames: list[cq.Solid] = []
    holes: list[cq.Solid] = []
    start = 0.0
    top = THICKNESS_MM + 1.0
    for pattern in patterns:
        if pattern.device not in (LIDAR_BODY, SERVO_HORN, SERVO_OUTPUT, SERVO_CASE):
            continue
        places = np.array(pattern.places)
        low, high = places.min(axis=0) - EDGE_MM, places.max(axis=0) + EDGE_MM
        moved = np.array([start, 0.0]) - low
        wide, tall = (high - low).tolist()
        frames.append(solids.box((start, 0.0, 0.0), (start + wide, tall, THICKNESS_MM)))
        middle = shapely.MultiPoint(places + moved).convex_hull.buffer(-EDGE_MM, join_style="mitre")
        if middle.area > LEAST_MM2:
            holes.append(solids.prism(np.asarray(middle.exterior.coords)[:-1], -1.0, top))
        boss = scanner.servo.horn_boss_diameter_mm
        if pattern.device in (SERVO_HORN, SERVO_OUTPUT) and boss:
            holes.append(solids.upright((boss + PLAY_MM) / 2, -1.0, top, *moved.tolist()))
        radius = passing_hole(pattern.screw, scanner.printer) / 2
        holes += [solids.upright(radius, -1.0, top, *place) for place in (places + moved).tolist()]
        start += wide - OVERLAP_MM
    if not frames:
        return None
    with building(TEST_PLATE, "frames and holes", "patterns", len(frames)) as checked:
        plate = frames[0].fuse(*frames[1:]) if frames[1:] else frames[0]
        return checked(plate.cut(*holes))

"""Test plate: the holes of lidar and servo in a thin plate, to print first and to screw to both devices.

Frame: its own, mm, on the bed with its upper side away from the device. The middle of each pattern is open.
"""

from collections.abc import Sequence

import cadquery as cq
import numpy as np
import shapely

from scanwright.cad import solids
from scanwright.cad.layout.joints import ScrewPattern
from scanwright.cad.layout.names import LIDAR_BODY, SERVO_CASE, SERVO_HORN, SERVO_OUTPUT, TEST_PLATE
from scanwright.cad.screws import passing_hole
from scanwright.cad.solids import building
from scanwright.design.scanner import Scanner

THICKNESS_MM = 1.2
EDGE_MM = 5.0  # around the axes of outer holes, and inside
OVERLAP_MM = 1.0  # of two frames
LEAST_MM2 = 60.0  # of an open middle
PLAY_MM = 0.6  # on the diameter of the horn's boss


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

"""Bought parts, true to size, as far as the catalogue knows them. Millimetres.

The lidar is made in its body frame (origin on the base at the optical axis, x to the front, z up), servo and
slip ring and bearing in the rotation frame at gamma = 0 (`cad/layout/direct_stack.py`).
"""

from __future__ import annotations

import math

import cadquery as cq

from cad import solids
from cad.layout.direct_stack import Stack
from cad.screws import SCREWS
from design.catalogue.products import Bearing, Lidar, Servo

CAP_INSET = 1.5
EAR_ROOM = 3.6  # radius of the recess around a case hole


def lidar_solids(lidar: Lidar) -> dict[str, cq.Solid]:
    """Body (with its threaded holes), window, cap and cables, in the body frame."""
    half_x, half_y, height = lidar.body_mm[0] / 2, lidar.body_mm[1] / 2, lidar.body_mm[2]
    low, high = lidar.window_z_mm
    radius = SCREWS[lidar.mount_screw].nominal / 2
    depth = min(lidar.mount_thread_depth_mm, low - 1.0)
    threads = [solids.upright(radius, -1.0, depth, x, y) for x, y in lidar.mount_holes_mm]
    body = solids.box((-half_x, -half_y, 0.0), (half_x, half_y, low)).cut(*threads)
    parts = {
        "lidar_body": body.Solids()[0],
        "lidar_window": solids.upright(lidar.window_radius_mm, low, high),
        "lidar_cap": solids.upright(min(half_x, half_y) - CAP_INSET, high, height),
    }
    for i, y in enumerate(lidar.cable_y_mm, start=1):
        start = (-half_x, y, lidar.cable_z_mm)
        stub = solids.cylinder(lidar.cable_diameter_mm / 2, start, (-1.0, 0.0, 0.0), lidar.cable_straight_mm)
        parts[f"lidar_cable_{i}"] = stub
    return parts


def servo_case(servo: Servo, z: float) -> cq.Solid:
    """The case, its horn face at height z, with recesses down to the planes of its front and rear holes."""
    (x0, y0, z0), (x1, y1, z1) = servo.case_min_mm, servo.case_max_mm
    recesses = [
        solids.upright(EAR_ROOM, z + servo.case_holes_z_mm, z + z1 + 1.0, *hole) for hole in servo.case_holes_mm
    ]
    recesses += [
        solids.upright(EAR_ROOM, z + z0 - 1.0, z + servo.case_rear_holes_z_mm, *hole)
        for hole in servo.case_rear_holes_mm
    ]
    return solids.box((x0, y0, z + z0), (x1, y1, z + z1)).cut(*recesses).Solids()[0]


def servo_horn(servo: Servo, z: float) -> cq.Solid:
    """The horn's disc with its threaded holes and boss, its face at height z."""
    disc: cq.Shape = solids.upright(servo.horn_diameter_mm / 2, z - servo.horn_thickness_mm, z)
    radius = SCREWS[servo.horn_screw].nominal / 2
    depth = min(servo.horn_thread_depth_mm, servo.horn_thickness_mm)
    centres = solids.polygon(servo.horn_circle_mm / 2, servo.horn_holes, math.radians(90.0 + servo.horn_first_hole_deg))
    disc = disc.cut(*(solids.upright(radius, z - depth, z + 1.0, float(x), float(y)) for x, y in centres))
    if servo.horn_boss_diameter_mm > 0 and servo.horn_boss_height_mm > 0:
        disc = disc.fuse(solids.upright(servo.horn_boss_diameter_mm / 2, z - 0.5, z + servo.horn_boss_height_mm))
    return disc.Solids()[0]


def ring_solids(stack: Stack) -> dict[str, cq.Solid]:
    """Stator and rotor of a through-bore ring; the split between them is not in any drawing."""
    bore, outer = stack.ring_bore / 2, stack.ring_radius
    split = bore + 0.4 * (outer - bore)
    rotor: cq.Shape = solids.upright(split - 0.2, stack.ring_bottom, stack.ring_top)
    rotor = rotor.cut(solids.upright(bore, stack.ring_bottom - 1.0, stack.ring_top + 1.0))
    stator: cq.Shape = solids.upright(outer, stack.ring_bottom + 1.0, stack.ring_top - 1.0)
    stator = stator.cut(solids.upright(split, stack.ring_bottom - 1.0, stack.ring_top + 1.0))
    return {"ring_stator": stator.Solids()[0], "ring_rotor": rotor.Solids()[0]}


def bearing_solids(bearing: Bearing, high: float) -> dict[str, cq.Solid]:
    """Inner and outer ring, their upper face at a height; the balls between them are left out."""
    inner, outer = bearing.bore_mm / 2, bearing.outer_mm / 2
    wall = 0.3 * (outer - inner)
    low = high - bearing.width_mm
    bodies = {"bearing_inner": (inner, inner + wall), "bearing_outer": (outer - wall, outer)}
    return {name: solids.lathe([(a, low), (b, low), (b, high), (a, high)]) for name, (a, b) in bodies.items()}

"""Estimated imbalance of a rotor, and the torque of gravity on it. Grams and mm."""

import math

import numpy as np

from scanwright.cad.layout.loads import noise_deg, tilt_sine
from scanwright.cad.layout.rotor.free_space import at_screws, behind_screws, in_box, in_fan, in_hull, swept
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage
from scanwright.design.arrays import Array
from scanwright.design.frames import STANDARD_GRAVITY_M_S2
from scanwright.design.motion import Sweep
from scanwright.design.scanner import Scanner

CELL = 2.0


def estimated_moment(scanner: Scanner, p: AlignmentLinkage, neck: Array) -> Array:
    """Return the mass times distance from the axis of lidar, linkage and sub-plate, rotation frame, shape (2,) [g mm].

    The linkage is a sum of cells, within 3 % of its solid (`tests/cad/parts/test_balance.py`); `neck` has shape (n, 3).
    """
    lidar, stack, R = scanner.lidar, p.stack, p.stack.R()
    reach = max(p.half_x, p.half_y) if p.ears is None else max(p.ears[1][:2])
    plate = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0.0, 1.0)])
    plate = plate * [reach, reach, p.seat - p.top + p.plate] + [0.0, 0.0, p.top - p.plate]
    r = stack.hub_radius
    corners = np.concatenate([neck, plate @ R.T, [[-r, -r, stack.shoulder], [r, r, -stack.h]]])
    axes = [np.arange(low + CELL / 2, high, CELL) for low, high in zip(corners.min(0), corners.max(0), strict=True)]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    in_laser = cells @ R
    x, y, z = np.abs(in_laser[:, 0]), np.abs(in_laser[:, 1]), in_laser[:, 2]
    on_plate = (x < p.half_x) & (y < p.half_y) & (x + y < p.half_x + p.half_y - p.chamfer)
    if p.ears is not None:
        on_plate |= (x < p.ears[1][0]) & (y < p.ears[1][1])
    solid = (on_plate & (z > p.top - p.plate) & (z < p.top)) | in_hull(cells, neck, 0.0)
    around = np.hypot(cells[:, 0], cells[:, 1])
    free = np.any([in_box(in_laser, swept(box), 0.0) for box in (p.body, *p.cables)], axis=0)
    solid &= ~in_fan(in_laser, p, 0.0) & ~behind_screws(in_laser, p)
    solid |= (around < stack.hub_radius) & (cells[:, 2] > stack.shoulder) & (cells[:, 2] < -stack.h)
    solid &= ~free & ~((around < stack.shaft_diameter / 2) & (cells[:, 2] < stack.spigot_top))
    if p.ears is not None:
        solid &= ~((z > p.top - p.screw.head_height) & (z < p.top) & at_screws(in_laser, p))  # pockets for heads
        solid |= on_plate & (z > p.top) & (z < p.seat)  # the sub-plate
    printed = CELL**3 * scanner.printer.density_g_cm3 / 1000 * cells[solid, :2].sum(axis=0)
    for low, high in (wall.box for wall in p.walls):
        grams = scanner.printer.density_g_cm3 / 1000 * float(np.prod(np.subtract(high, low)))
        printed += grams * (R @ np.add(low, high) / 2)[:2]
    return printed + lidar.mass_g * (lidar.body_mm[2] / 2 - lidar.optical_height_mm) * R[:2, 2]


def torque_nm(scanner: Scanner, moment: float) -> float:
    """Return the largest torque of gravity about the axis over a turn, for an imbalance [g mm]."""
    return moment * 1e-6 * STANDARD_GRAVITY_M_S2 * tilt_sine(scanner)


def keeps_flank(scanner: Scanner, moment: Array, error: float = 0.0) -> bool:
    """Return whether gravity turns the rotor one way only over the whole sweep: the gears then keep one flank.

    Args:
        scanner: angles and products.
        moment: mass times distance from the axis, shape (2,), or the distance alone: any unit.
        error: of the moment in any direction, same unit.
    """
    motion = scanner.angles.motion
    if not isinstance(motion, Sweep):
        return False
    down = -scanner.angles.T_world_rot(0.0)[2, :3]
    gamma = np.radians(np.linspace(*motion.limits_deg, 361))
    x = np.cos(gamma) * moment[0] - np.sin(gamma) * moment[1]
    y = np.sin(gamma) * moment[0] + np.cos(gamma) * moment[1]
    torque = x * down[1] - y * down[0]
    least = error * math.hypot(down[0], down[1])
    return bool((torque > least).all() or (torque < -least).all())


def backlash_matters(scanner: Scanner) -> bool:
    """Return whether the servo's backlash shows in a cloud, or is unknown."""
    backlash = scanner.servo.backlash_deg
    return backlash is None or backlash > noise_deg(scanner)

"""What every body of a scanner weighs, and where: for the URDF, the checks and the counterweight."""

from __future__ import annotations

import numpy as np

from cad.assembly.assembly import Assembly
from cad.geometry import inertia
from cad.geometry.inertia import Inertial
from cad.layout.balance import PART as COUNTERWEIGHT
from cad.layout.balance import STEEL_G_CM3
from cad.layout.loads import ALUMINIUM_G_CM3
from design.frames import Array
from design.scanner import Scanner


def link_bodies(scanner: Scanner, assembly: Assembly) -> dict[str, Inertial]:
    """Mass properties of the URDF's links: servo and rot in the rotation frame, laser in the laser frame.

    Of bought parts only mass and size are known: homogeneous boxes; half of ring and bearing turns.
    """
    lidar = scanner.lidar
    own = {name: inertia.of_solid(s, density_g_cm3(name, scanner, assembly)) for name, s in assembly.made.items()}
    bought_standing, bought_turning = assembly.drive.weights()
    standing = [*(own[name] for name in assembly.standing_parts()), *bought_standing]
    turning = [*(own[name] for name in assembly.turning_parts()), *bought_turning]
    x, y, z = lidar.body_mm
    base = -lidar.optical_height_mm
    laser = inertia.of_box(lidar.mass_g, (-x / 2, -y / 2, base), (x / 2, y / 2, base + z))
    return {"servo": inertia.together(standing), "rot": inertia.together(turning), "laser": laser}


def density_g_cm3(name: str, scanner: Scanner, assembly: Assembly) -> float:
    """Of a made part."""
    if name == COUNTERWEIGHT:
        return STEEL_G_CM3
    return ALUMINIUM_G_CM3 if name in assembly.metal() else scanner.printer.density_g_cm3


def rotor_moment(scanner: Scanner, assembly: Assembly) -> Array:
    """Mass times distance from the axis of all that turns, shape (2,) [g mm]."""
    bodies = link_bodies(scanner, assembly)
    rotor = inertia.together([bodies["rot"], bodies["laser"].moved(scanner.angles.T_rot_laser())])
    return np.asarray(1e6 * rotor.mass_kg * rotor.centre_m[:2])

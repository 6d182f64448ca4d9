"""Mass properties of the bodies of a scanner, for the URDF, the checks and the counterweight."""

import math
from collections.abc import Mapping

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.geometry import inertia
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.cables.leads import SAMPLE
from scanwright.cad.layout.hub import Hub
from scanwright.cad.layout.loads import Weight, weight_of
from scanwright.design.arrays import Array
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.scanner import Scanner

LIDAR_CENTRE_ERROR_MM = 2.0
"""Error of a lidar's centre of mass from the middle of its box, in any direction: assumed, undocumented.

Motor, mirror and most boards are around its axis; plugs and windows, a tenth of it, are 20 mm off.
"""


def link_bodies(assembly: Assembly) -> dict[str, Inertial]:
    """Return the mass properties of the URDF's links: servo and rot in the rotation frame, laser in the laser frame.

    Bought parts are homogeneous boxes, of which a share may turn; cables are lines.
    """
    masses = assembly.layout.drive.masses
    fixed = [assembly.inertial(name) for name in assembly.fixed_parts()]
    fixed += [inertia.of_box((1 - each.turning) * mass_g, *box) for each, mass_g, box in masses]
    fixed += [inertia.of_line(lead.mass_g, lead.path.points(SAMPLE)) for lead in assembly.layout.cables if lead.path]
    turning = [assembly.inertial(name) for name in assembly.turning_parts()]
    turning += [inertia.of_box(each.turning * mass_g, *box) for each, mass_g, box in masses if each.turning > 0]
    turning += [inertia.of_line(lead.mass_g, lead.path.points(SAMPLE)) for lead in assembly.layout.leads if lead.path]
    lidar = lidar_body(assembly.layout.scanner.lidar)
    return {"servo": inertia.together(fixed), "rot": inertia.together(turning), "laser": lidar}


def lidar_body(lidar: Lidar) -> Inertial:
    """Return the lidar as a homogeneous box, laser frame."""
    (x, y, z), base = lidar.body_mm, -lidar.optical_height_mm
    return inertia.of_box(lidar.mass_g, (-x / 2, -y / 2, base), (x / 2, y / 2, base + z))


def rotor_of(scanner: Scanner, bodies: Mapping[str, Inertial]) -> Inertial:
    """Return all that turns, rotation frame, from the bodies of `link_bodies`."""
    return inertia.together([bodies["rot"], bodies["laser"].moved(scanner.angles.T_rot_laser())])


def rotor_weight(scanner: Scanner, stack: Hub, bodies: Mapping[str, Inertial]) -> Weight:
    """Return the weight of all that turns, from the bodies of `link_bodies`."""
    rotor = rotor_of(scanner, bodies)
    x, y, z = rotor.centre_m
    return weight_of(scanner, rotor.mass_kg, float(z) - stack.horn / 1000, math.hypot(x, y))


def off_axis_error_m(bodies: Mapping[str, Inertial]) -> float:
    """Return the error of the rotor's centre of mass across the axis: that of the lidar is undocumented."""
    lidar, rot = bodies["laser"].mass_kg, bodies["rot"].mass_kg
    return LIDAR_CENTRE_ERROR_MM / 1000 * lidar / (lidar + rot)


def rotor_moment(assembly: Assembly) -> Array:
    """Return the mass times distance from the axis of all that turns, shape (2,) [g mm]."""
    rotor = rotor_of(assembly.layout.scanner, link_bodies(assembly))
    return np.asarray(1e6 * rotor.mass_kg * rotor.centre_m[:2])

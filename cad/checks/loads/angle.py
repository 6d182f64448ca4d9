"""Whether the mount keeps its angle about the axis: friction of its clamp, and the largest slip."""

import math

import numpy as np

from scanwright.cad.assembly.assembly import LIDAR_CENTRE_ERROR_MM, Assembly
from scanwright.cad.checks.loads.retention import hanging_on, material_of, together_of
from scanwright.cad.checks.table import at_least, figures
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.loads import friction_nm
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage, cross_seat_mm
from scanwright.cad.layout.tightening import FRICTION, HELD_G, LEAST_MARGIN, hold_of
from scanwright.design.findings import Finding
from scanwright.design.frames import STANDARD_GRAVITY_M_S2


def angle_checks(assembly: Assembly) -> list[Finding]:
    """Check the friction of hub on shaft against HELD_G on the imbalance and the drag of the ring.

    The screws press the hub's bore onto the shaft, with the preload that creep leaves (`tightening.PRINTED`). Friction
    under their heads is neglected.
    """
    layout, scanner = assembly.layout, assembly.layout.scanner
    joint = next(each for each in layout.joints if (each.part, each.onto) == (ALIGNMENT_LINKAGE, layout.drive.shaft))
    hold = hold_of(joint, material_of(assembly, joint.part), material_of(assembly, joint.onto))
    assert hold is not None
    body = together_of(assembly, hanging_on(assembly, joint))
    imbalance = body.mass_kg * math.hypot(*body.centre_m[:2]) + scanner.lidar.mass_g * LIDAR_CENTRE_ERROR_MM * 1e-6
    turns = HELD_G * STANDARD_GRAVITY_M_S2 * imbalance + friction_nm(scanner)[1]
    pressed = hold.preload_n * float(np.linalg.norm(np.sum([axis.along for axis in joint.axes], axis=0)))
    holds = FRICTION * pressed * layout.stack.shaft_diameter / 2000
    what = (
        f"{joint.count} x {joint.screw.name} hold its angle with {figures(holds)} N m of friction on {joint.onto}, "
        f"{HELD_G:g} g and drag of the ring turn it with {figures(turns)} N m; a slip ends after "
        f"{slip_deg(layout.linkage, joint):.1f} deg, by the flat of the shaft or the screws: margin"
    )
    return [at_least("angle_held", holds / turns, LEAST_MARGIN, "times", ALIGNMENT_LINKAGE, what)]


def slip_deg(linkage: AlignmentLinkage, joint: Joint) -> float:
    """Return the backlash of the hub on its shaft [deg], limited by the flat or by the shanks of the screws.

    The flat's edges meet the wall of the bore, or the shanks that of their holes.
    """
    stack = linkage.stack
    radius = stack.shaft_diameter / 2
    by_flat = math.acos(stack.flat / radius) - math.acos(min(1.0, (stack.flat + linkage.fit / 2) / radius))
    by_screws = (linkage.cross_hole - joint.screw.nominal) / 2 / cross_seat_mm(stack)
    return 2 * math.degrees(min(by_flat, by_screws))

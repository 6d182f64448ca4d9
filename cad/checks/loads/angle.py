"""Whether the mount keeps its angle about the axis: friction of its clamp, and the largest slip."""

import math

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.checks.loads.retention import hanging_on, together_of
from scanwright.cad.checks.table import at_least, figures
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.cad.layout.rotor.cross_screws import cross_joint, held_nm, slip_deg, turning_nm
from scanwright.cad.layout.tightening import HELD_G, LEAST_MARGIN
from scanwright.design.findings import Finding


def angle_checks(assembly: Assembly) -> list[Finding]:
    """Check the friction of hub on shaft against HELD_G on the imbalance and the drag of the ring."""
    layout = assembly.layout
    joint = cross_joint(layout.linkage, layout.drive.shaft)
    body = together_of(assembly, hanging_on(assembly, joint))
    turns = turning_nm(layout.scanner, body.mass_kg * math.hypot(*body.centre_m[:2]))
    holds = held_nm(layout.stack, joint)
    what = (
        f"{joint.count} x {joint.screw.name} hold its angle with {figures(holds)} N m of friction on {joint.onto}, "
        f"{HELD_G:g} g and drag of the ring turn it with {figures(turns)} N m; a slip ends after "
        f"{slip_deg(layout.linkage, joint):.1f} deg, by the flat of the shaft or the screws: margin"
    )
    return [at_least("angle_held", holds / turns, LEAST_MARGIN, "times", ALIGNMENT_LINKAGE, what)]

"""Load of the rotor's weight on the horn, and the bearing of a tilted axis. No kernel.

Without a bearing the horn carries the tilt moment through a turned shaft or a printed cup. With one the shaft is a
beam, clamped in the horn and supported by the cage, a spring, at the bearing; its waist is the thinnest piece of that
beam. SI units; lengths of the stack are millimetres.
"""

import math
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.direct.stack import CAGE_SEAT_WALL, DirectStack
from scanwright.cad.layout.envelope import sub_plate_cm3
from scanwright.cad.layout.hub import BUNDLE_GAP, JOURNAL_WALL
from scanwright.cad.layout.joints import horn_joint
from scanwright.cad.layout.loads import (
    ALUMINIUM_G_CM3,
    ALUMINIUM_PA,
    METAL_POISSON,
    STEEL_G_CM3,
    ShaftBend,
    Weight,
    tilt_sine,
    trusted_moment_nm,
    weight_of,
)
from scanwright.cad.layout.names import BEARING_CAGE, SERVO_HORN
from scanwright.cad.layout.tightening import ALUMINIUM as TURNED
from scanwright.cad.layout.tightening import BOUGHT, MOULDED, PRINTED, SHOCK_G, hold_of
from scanwright.design.catalogue.products import Bearing
from scanwright.design.errors import BuildError
from scanwright.design.frames import STANDARD_GRAVITY_M_S2
from scanwright.design.scanner import Scanner

LINKAGE_CM3 = 125.0  # the heaviest linkage of the 300 settings of benchmarks/cad/parts.py, rounded up
LINKAGE_OFF_AXIS_MM = 20.0
PRISM_SHARE = 0.4  # of a prism from a large lidar's base to the hub that its linkage fills: up to LMS111, 450 cm3
SEAT_SHARE = 0.8  # of the distance of its base from the axis at which such a linkage has its centre
LEADS_DEPTH = 6.0  # least depth of the channel for the ring's leads
SHEAR_SHARE = 0.9  # of a round section that carries shear


@dataclass(frozen=True, slots=True)
class ShaftMetal:
    """Metal of a turned shaft."""

    name: str  # order name
    modulus_pa: float  # of elasticity
    waist: float  # diameter of the waist in this metal, as a share of that in aluminium
    yields_pa: float  # shear stress at which it yields
    density_g_cm3: float

    def twisted_off_nm(self, waist_diameter: float) -> float:
        """Return the torque at which a waist yields; its diameter is stated for aluminium."""
        return self.yields_pa * math.pi * (self.waist * waist_diameter / 1000) ** 3 / 16


# 0.2 % proof stress of 430 MPa (EN 755-2, bars) and 900 MPa (EN ISO 683-2, to 16 mm), by von Mises
ALUMINIUM = ShaftMetal("aluminium EN AW-7075-T6", ALUMINIUM_PA, 1.0, 0.577 * 430e6, 2.81)
# as stiff as aluminium: (70 / 206) ** 0.25
STEEL = ShaftMetal("steel 42CrMo4+QT", 206e9, 0.76, 0.577 * 900e6, STEEL_G_CM3)


@dataclass(frozen=True, slots=True)
class Supported:
    """How horn and bearing share the weight."""

    horn_moment_nm: float
    bearing_force_n: float
    slope_rad: float  # of the shaft at the hub
    misaligned_nm_per_m: float = 0.0  # moment on the horn for each metre that the bearing is out of its line


def bearing_for(scanner: Scanner, stack: DirectStack) -> Bearing | None:
    """Return the smallest bearing around shaft and leads and in the cage; None without a ring if there is none.

    Raises:
        BuildError: the leads of the ring need more space than any bearing leaves.
    """
    depth = max(LEADS_DEPTH, stack.lead_diameter + 2 * BUNDLE_GAP)
    least = stack.shaft_diameter + 2 * JOURNAL_WALL + (0.0 if scanner.slip_ring is None else 2 * depth)
    most = 2 * (stack.cage_outer - CAGE_SEAT_WALL)
    fit = next((one for one in scanner.bearings if least <= one.bore_mm and one.outer_mm < most), None)
    ring = scanner.slip_ring
    if fit is None and ring is not None and scanner.bearings:
        raise BuildError(
            f"{BEARING_CAGE}: slip_ring {ring.name}: lead_diameter_mm = {ring.lead_diameter_mm}"
            f"{ring.caution('lead_diameter_mm')}: the axis needs a bearing around shaft and leads with a bore of "
            f"{least:.1f} mm that is less than {most:.1f} mm wide, and the catalogue has none; take a ring with fewer "
            "circuits"
        )
    return fit


def horn_bears(scanner: Scanner, stack: DirectStack) -> bool:
    """Return whether the horn bears the heaviest linkage of any angles without a bearing, and its screws a shock of it.

    A horn without a rating is assumed to bear little.
    """
    weight, servo = heaviest(scanner, stack), scanner.servo
    lever_m = math.hypot(weight.lever_m, weight.off_axis_m)
    per_screw = (1 + 4000 * lever_m / servo.horn_circle_mm) / servo.horn_holes  # equal springs on a circle
    pull_n = SHOCK_G * math.hypot(weight.across_n, weight.along_n) * per_screw
    joint = horn_joint(servo, stack.shaft, SERVO_HORN, stack.horn + stack.horn_grip, stack.horn_grip)
    printed = stack.cup_bore > 0
    hold = hold_of(joint, PRINTED if printed else TURNED, MOULDED if servo.horn_kind == "self_tapping" else BOUGHT)
    return weight.moment_nm <= trusted_moment_nm(scanner) and hold is not None and pull_n <= hold.pull_n


def horn_bears_balanced(scanner: Scanner, stack: DirectStack, bar_g: float, bar_z: float) -> bool:
    """Return whether the horn bears the heaviest linkage and a bar of this mass and height that balances it."""
    weight = heaviest(scanner, stack)
    bar = bar_g / 1000 * STANDARD_GRAVITY_M_S2 * tilt_sine(scanner) * (bar_z - stack.horn) / 1000
    return weight.across_n * weight.lever_m + bar <= trusted_moment_nm(scanner)


def supported(weight: Weight, stack: DirectStack, cage_n_per_m: float, metal: ShaftMetal = ALUMINIUM) -> Supported:
    """Share the weight of all that turns: the deflections of shaft and cage are equal at the bearing."""
    b = (stack.bearing_middle - stack.horn) / 1000
    waist = metal.waist * stack.waist_diameter
    above_horn, thick = stack.slices(1000 * b, waist)
    z = above_horn / 1000
    EI = metal.modulus_pa * math.pi / 4 * (stack.radius_at(above_horn, waist) / 1000) ** 4
    moment = weight.across_n * (weight.lever_m - z) + weight.along_n * weight.off_axis_m
    bend, reach = thick / 1000 / EI, b - z
    give = float((bend * reach**2).sum()) + 1 / cage_n_per_m
    R = float((bend * reach * moment).sum()) / give
    over = (stack.shoulder - stack.bearing_middle) / 1000
    beyond = weight.across_n * (weight.lever_m - b - over / 2) + weight.along_n * weight.off_axis_m
    shaft = metal.modulus_pa * math.pi / 64 * (stack.shaft_diameter / 1000) ** 4
    slope = float((bend * (moment - R * reach)).sum()) + over * beyond / shaft
    foot = weight.across_n * weight.lever_m + weight.along_n * weight.off_axis_m
    return Supported(abs(foot - R * b), R, abs(slope), b / give)


def hanging(weight: Weight, stack: DirectStack, modulus_pa: float) -> Supported:
    """Return the load of a horn that carries alone: a cantilever up to the rigid hub, of this modulus."""
    above_horn, thick = stack.slices(stack.shoulder - stack.horn, stack.waist_diameter)
    outer, inner = stack.radius_at(above_horn, stack.waist_diameter) / 1000, stack.bore_at(above_horn) / 1000
    moment = weight.across_n * (weight.lever_m - above_horn / 1000) + weight.along_n * weight.off_axis_m
    slope = float((moment * thick / 1000 / (modulus_pa * math.pi / 4 * (outer**4 - inner**4))).sum())
    return Supported(weight.moment_nm, 0.0, slope)


def shaft_bend(
    stack: DirectStack, modulus_pa: float = ALUMINIUM_PA, cage_n_per_m: float = 0.0, horn_rad_per_nm: float = 0.0
) -> ShaftBend:
    """Return the compliance of the shaft at the hub.

    Round sections or tubes (Timoshenko), clamped in the horn; a spring braces it sideways at the bearing. A bearing's
    sleeve, which is loose by its fit, does not stiffen it.

    Args:
        stack: its lengths and radii.
        modulus_pa: of elasticity.
        cage_n_per_m: sideways stiffness of the cage that holds the bearing, 0 without one.
        horn_rad_per_nm: how far a moment tilts the horn.
    """
    length = (stack.shoulder - stack.horn) / 1000
    above_horn, thick = stack.slices(1000 * length, stack.waist_diameter)
    z, dz = above_horn / 1000, thick / 1000
    outer, inner = stack.radius_at(above_horn, stack.waist_diameter) / 1000, stack.bore_at(above_horn) / 1000
    area, second_moment = math.pi * (outer**2 - inner**2), math.pi / 4 * (outer**4 - inner**4)
    shear_pa = modulus_pa / (2 + 2 * METAL_POISSON)
    lever = length - z
    bend = dz / (modulus_pa * second_moment)
    shear = float((dz / (SHEAR_SHARE * shear_pa * area)).sum())
    free = np.array(
        [[(bend * lever**2).sum() + shear, (bend * lever).sum()], [(bend * lever).sum(), bend.sum()]]
    )  # of force and moment at the end
    free += horn_rad_per_nm * np.array([[length**2, length], [length, 1.0]])
    b = (stack.bearing_middle - stack.horn) / 1000  # of the bearing
    reach = np.maximum(b - z, 0.0)
    shear = float((dz / (SHEAR_SHARE * shear_pa * area))[z < b].sum())
    there = np.array([(bend * reach * lever).sum() + shear, (bend * reach).sum()])  # of force and moment at the end
    there += horn_rad_per_nm * b * np.array([length, 1.0])
    own = float((bend * reach**2).sum()) + shear + horn_rad_per_nm * b**2  # of a force at the bearing
    braced = np.outer(there, there) * cage_n_per_m / (1 + cage_n_per_m * own)
    return ShaftBend(
        compliance=free - braced,
        twist_rad_per_nm=float((dz / (shear_pa * 2 * second_moment)).sum()),
        stretch_m_per_n=float((dz / (modulus_pa * area)).sum()),
    )


def shaft_modulus_pa(scanner: Scanner, stack: DirectStack) -> float:
    """Return the elastic modulus of the shaft: of the print for a cup, else of aluminium."""
    return 1e9 * scanner.printer.modulus_gpa if stack.cup_bore > 0 else ALUMINIUM_PA


def heaviest(scanner: Scanner, stack: DirectStack) -> Weight:
    """Return the weight of the rotor with the heaviest linkage."""
    lidar, ring = scanner.lidar, scanner.slip_ring
    normal = stack.R()[:, 2]
    lies = math.hypot(normal[0], normal[1])
    middle = lidar.body_mm[2] / 2 - lidar.optical_height_mm
    prism = PRISM_SHARE * 4 * lidar.half_mm[0] * lidar.half_mm[1] * stack.h / 1000
    larger = max(1.0, prism / LINKAGE_CM3)
    off_axis = max(LINKAGE_OFF_AXIS_MM, min(larger * LINKAGE_OFF_AXIS_MM, SEAT_SHARE * lidar.optical_height_mm * lies))
    bodies = [  # mass [g], height, distance from the axis
        (lidar.mass_g, middle * float(normal[2]), abs(middle) * lies),
        ((larger * LINKAGE_CM3 + sub_plate_cm3(lidar)) * scanner.printer.density_g_cm3, -stack.h / 2, off_axis),
        (_shaft_g(scanner, stack), (stack.spigot_top + stack.horn) / 2, 0.0),
    ]
    if ring is not None:
        bodies.append((ring.mass_g / 2, (stack.ring_top + stack.ring_bottom) / 2, 0.0))
    mass = sum(body[0] for body in bodies)
    lever = sum(m * (z - stack.horn) for m, z, _ in bodies) / mass
    off_axis = sum(m * r for m, _, r in bodies) / mass
    return weight_of(scanner, mass / 1000, lever / 1000, off_axis / 1000)


def _shaft_g(scanner: Scanner, stack: DirectStack) -> float:
    """Return the mass of the plain shaft, or of a cup with its flange."""
    density = scanner.printer.density_g_cm3 if stack.cup_bore > 0 else ALUMINIUM_G_CM3
    section = stack.shaft_diameter**2 - stack.cup_bore**2
    flange = (2 * stack.flange_radius) ** 2 * stack.flange_thickness if stack.cup_bore > 0 else 0.0
    return density / 1000 * math.pi / 4 * (section * (stack.spigot_top - stack.horn) + flange)

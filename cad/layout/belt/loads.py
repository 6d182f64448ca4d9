"""Loads of the belt drive: rotor on two bearings, belt on the horn. SI units; the stack is in mm. No kernel.

SI units; lengths of the stack are millimetres.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.drive import TorqueLimit
from scanwright.cad.layout.loads import ALUMINIUM_PA, METAL_POISSON, ShaftBend, Weight, rated_moment_nm
from scanwright.design.scanner import Scanner

PRELOAD_N = 10.0  # least, of each strand: assumed for the seat of a small belt in its grooves
SEAT_N_PER_M = 10e6  # sideways stiffness of a bearing in a printed seat: assumed
PRELOAD_SHARE = 1.0  # of the largest working pull: twice the least that keeps the slack strand tight


@dataclass(frozen=True, slots=True)
class BeltPull:
    """Forces of the belt."""

    working_n: float  # largest pull beyond the pre-load
    strand_n: float  # pre-load of each strand
    shaft_n: float  # force of both strands between shaft and horn
    horn_nm: float  # its moment on the horn


def belt_pull(stack: BeltStack, torque_nm: float) -> BeltPull:
    """Return the forces of the belt at the largest torque of the servo in operation."""
    working = torque_nm / (stack.pitch_radius / 1000)
    strand = max(PRELOAD_N, PRELOAD_SHARE * working)
    lever = (stack.belt_middle - stack.horn) / 1000
    return BeltPull(working, strand, 2 * strand, 2 * strand * lever)


def belt_limits(scanner: Scanner, stack: BeltStack) -> Iterator[TorqueLimit]:
    """Yield the limits of the belt and, if it is rated, of the servo's horn."""
    radius, bored = stack.pitch_radius / 1000, "a ring with a bore"
    most_n = stack.belt.working_tension_n / (PRELOAD_SHARE + 0.5)
    yield TorqueLimit(most_n * radius, f"the working tension of {stack.belt.name}", bored)
    if (rated := rated_moment_nm(scanner)) is not None:
        most_n = rated / (2 * PRELOAD_SHARE * (stack.belt_middle - stack.horn) / 1000)
        yield TorqueLimit(most_n * radius, f"the pull of the belt on the horn of {scanner.servo.name}", bored)


def carrier_forces(stack: BeltStack, weight: Weight, centre_mm: float, pull_n: float) -> tuple[float, float]:
    """Return the force across the upper and the lower bearing [N] if weight and belt pull in the same direction.

    `centre_mm` is the height of the rotor's centre of mass, rotation frame, `pull_n` the pull of both strands.
    """
    span = stack.upper_middle - stack.lower_middle
    moment = 1000 * weight.along_n * weight.off_axis_m  # N mm
    arms = (weight.across_n, centre_mm), (pull_n, stack.belt_middle)
    upper = sum(force * abs(z - stack.lower_middle) for force, z in arms) + moment
    lower = sum(force * abs(z - stack.upper_middle) for force, z in arms) + moment
    return upper / span, lower / span


def belt_nm_per_rad(stack: BeltStack) -> float:
    """Return the stiffness of both strands about the axis, with the servo fixed."""
    return 2 * stack.belt.stiffness_n / (stack.centre / 1000) * (stack.pitch_radius / 1000) ** 2


def belt_shaft_bend(stack: BeltStack, seat_m_per_n: float = 0.0) -> ShaftBend:
    """Return the compliance of the shaft at the hub; `seat_m_per_n` is that of each support.

    A tube on two supports, its hub beyond the upper one; the belt is two springs against turning.
    """
    second_moment = math.pi / 64 * (stack.tube_diameter**4 - stack.shaft_bore**4) * 1e-12  # m4
    EI, shear_pa = ALUMINIUM_PA * second_moment, ALUMINIUM_PA / (2 + 2 * METAL_POISSON)
    twist = (stack.shoulder - stack.belt_middle) / 1000 / (shear_pa * 2 * second_moment)
    span = (stack.upper_middle - stack.lower_middle) / 1000
    over = (stack.shoulder - stack.upper_middle) / 1000
    coupled = over * span / (3 * EI) + over**2 / (2 * EI)
    area = math.pi * (stack.tube_diameter**2 - stack.shaft_bore**2) / 4e6
    carried = np.array([[1 + over / span, over / span], [1 / span, 1 / span]])  # by the supports, of force and moment
    return ShaftBend(
        compliance=np.array(
            [
                [over**2 * span / (3 * EI) + over**3 / (3 * EI), coupled],
                [coupled, span / (3 * EI) + over / EI],
            ]
        )
        + seat_m_per_n * carried @ carried.T,
        twist_rad_per_nm=1 / belt_nm_per_rad(stack) + twist,
        stretch_m_per_n=over / (ALUMINIUM_PA * area),
    )


def press_newton(stack: BeltStack, strand_n: float, give_mm: float) -> float:
    """Return the force in the middle of a strand that moves it by `give_mm`: a test of its pre-load."""
    return 4 * strand_n * give_mm / stack.centre

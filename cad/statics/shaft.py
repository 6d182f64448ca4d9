"""How far the shaft bends and twists at the hub. SI units.

On the servo's axis it is a beam of round sections or tubes (Timoshenko), clamped in the horn; where a bearing holds it,
a spring holds the bearing's sleeve sideways. Beside the servo it is a tube on two supports that are taken for stiff,
its hub beyond the upper one, and the belt is two springs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scanwright.cad.layout.belt.loads import belt_nm_per_rad
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.loads import ALUMINIUM_PA
from scanwright.design.arrays import Array

POISSON = 0.33
SHEAR_SHARE = 0.9  # of a round section that carries shear


@dataclass(frozen=True, slots=True)
class ShaftBend:
    """What a load at the hub's lower end does to it. A force along x bends it about y, and so all around.

    Attributes:
        compliance: (sideways, slope) of (force, moment), shape (2, 2) [m, rad per N, N m].
        twist_rad_per_nm: about the axis.
        stretch_m_per_n: along the axis.
    """

    compliance: Array
    twist_rad_per_nm: float
    stretch_m_per_n: float

    def rotation_of(self, force_n: Array, moment_nm: Array) -> Array:
        """Rotation of the hub [rad], rotation frame; force and moment act on it at the height of its lower end."""
        along = np.array([-force_n[1], force_n[0], 0.0])  # z x force
        bend = self.compliance[1, 0] * along + self.compliance[1, 1] * np.array([*moment_nm[:2], 0.0])
        return bend + np.array([0.0, 0.0, self.twist_rad_per_nm * moment_nm[2]])

    def shift_of(self, force_n: Array, moment_nm: Array) -> Array:
        """Displacement of the hub's lower end [m]."""
        across = np.array([moment_nm[1], -moment_nm[0], 0.0])  # moment x z
        bend = self.compliance[0, 0] * np.array([*force_n[:2], 0.0]) + self.compliance[0, 1] * across
        return bend + np.array([0.0, 0.0, self.stretch_m_per_n * force_n[2]])


def shaft_bend(stack: DirectStack, modulus_pa: float = ALUMINIUM_PA, cage_n_per_m: float = 0.0) -> ShaftBend:
    """The beam from horn to hub.

    Args:
        stack: its lengths and radii.
        modulus_pa: of elasticity.
        cage_n_per_m: sideways stiffness of the cage that holds the bearing, 0 without one.
    """
    length = (stack.hub_bottom - stack.horn) / 1000
    above_horn, thick = stack.slices(1000 * length, stack.waist_diameter)
    z, dz = above_horn / 1000, thick / 1000
    outer, inner = stack.radius_at(above_horn, stack.waist_diameter) / 1000, stack.bore_at(above_horn) / 1000
    area, second_moment = math.pi * (outer**2 - inner**2), math.pi / 4 * (outer**4 - inner**4)
    shear_pa = modulus_pa / (2 + 2 * POISSON)
    lever = length - z
    bend = dz / (modulus_pa * second_moment)
    shear = float((dz / (SHEAR_SHARE * shear_pa * area)).sum())
    free = np.array(
        [[(bend * lever**2).sum() + shear, (bend * lever).sum()], [(bend * lever).sum(), bend.sum()]]
    )  # of force and moment at the end
    reach = np.array([1.0, (stack.bearing_middle - stack.hub_bottom) / 1000])  # the bearing moves by this
    held = np.outer(free @ reach, reach @ free) * cage_n_per_m / (1 + cage_n_per_m * float(reach @ free @ reach))
    return ShaftBend(
        compliance=free - held,
        twist_rad_per_nm=float((dz / (shear_pa * 2 * second_moment)).sum()),
        stretch_m_per_n=float((dz / (modulus_pa * area)).sum()),
    )


def belt_shaft_bend(stack: BeltStack) -> ShaftBend:
    """The shaft beyond its upper bearing, the span below it, and the belt that holds it from turning."""
    EI = ALUMINIUM_PA * _second_moment(stack)
    span = (stack.upper_middle - stack.lower_middle) / 1000
    over = (stack.hub_bottom - stack.upper_middle) / 1000
    coupled = over * span / (3 * EI) + over**2 / (2 * EI)
    area = math.pi * (stack.tube_diameter**2 - stack.shaft_bore**2) / 4e6
    return ShaftBend(
        compliance=np.array(
            [
                [over**2 * span / (3 * EI) + over**3 / (3 * EI), coupled],
                [coupled, span / (3 * EI) + over / EI],
            ]
        ),
        twist_rad_per_nm=1 / belt_nm_per_rad(stack) + _twist(stack),
        stretch_m_per_n=over / (ALUMINIUM_PA * area),
    )


def _second_moment(stack: BeltStack) -> float:
    """Of the tube [m4]."""
    return math.pi / 64 * (stack.tube_diameter**4 - stack.shaft_bore**4) * 1e-12


def _twist(stack: BeltStack) -> float:
    shear = ALUMINIUM_PA / (2 + 2 * POISSON)
    return (stack.hub_bottom - stack.belt_middle) / 1000 / (shear * 2 * _second_moment(stack))

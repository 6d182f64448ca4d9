"""Vibration of rigid bodies in a row on springs: natural frequencies, and the response to a rotating force.

The bodies are numbered from the deck; body i is on spring i, which is on body i - 1 or on the deck. The unknowns are
the springs' deformations, six each (`spring.py`): the stiffness is block-diagonal.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, eigh

from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.statics.spring import Spring
from scanwright.design.arrays import Array
from scanwright.design.frames import cross_matrix


@dataclass(frozen=True, slots=True)
class SpringRow:
    """Bodies on springs: stiffness and mass of the springs' deformations, shape (6 n, 6 n)."""

    stiffness: Array
    mass: Array

    def frequencies_hz(self) -> Array:
        """Return the natural frequencies, ascending."""
        return np.sqrt(eigh(self.stiffness, self.mass, eigvals_only=True)) / (2 * np.pi)

    def moved(self, load: Array, frequency_hz: float, loss: float) -> Array:
        """Return the displacement of the last body by a load on it that turns or swings, complex, shape (6,).

        Args:
            load: complex amplitudes at the origin, shape (6,).
            frequency_hz: of the load.
            loss: factor of the material: energy lost per radian over the energy stored.
        """
        count = len(self.mass) // 6
        dynamic = (1 + 1j * loss) * self.stiffness - (2 * np.pi * frequency_hz) ** 2 * self.mass
        return np.asarray(np.linalg.solve(dynamic, np.tile(load, count)).reshape(count, 6).sum(axis=0))


def row_of(springs: Sequence[Spring], masses: Sequence[Array]) -> SpringRow:
    """Return the bodies with these mass matrices (6, 6) on these springs."""
    count = len(springs)
    mass = np.zeros((count, 6, count, 6))
    for i, (spring, body) in enumerate(zip(springs, masses, strict=True)):
        mass[: i + 1, :, : i + 1] += body[None, :, None]
        mass[:i, :, :i] += spring.rigid[None, :, None]
        mass[:i, :, i] += spring.coupled
        mass[i, :, :i] += spring.coupled.T[:, None]
        mass[i, :, i] += spring.own
    stiffness = block_diag(*(np.linalg.inv(spring.compliance) for spring in springs))
    return SpringRow(stiffness, mass.reshape(6 * count, -1))


def mass_matrix(body: Inertial) -> Array:
    """Return the mass matrix of a rigid body for a rotation and a shift at the origin, shape (6, 6)."""
    arm = cross_matrix(body.centre_m)
    turning = body.inertia_kg_m2 - body.mass_kg * arm @ arm
    coupled = body.mass_kg * arm
    return np.block([[turning, coupled], [coupled.T, body.mass_kg * np.eye(3)]])

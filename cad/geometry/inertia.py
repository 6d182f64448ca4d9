"""Mass, centre of mass and inertia of bodies. SI units; rotation frame unless stated."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cadquery as cq
import numpy as np
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps

from scanwright.design.arrays import Array


@dataclass(frozen=True, slots=True)
class Inertial:
    """A rigid body."""

    mass_kg: float
    centre_m: Array  # (3,)
    inertia_kg_m2: Array  # (3, 3), about the centre of mass

    def moved(self, T: Array) -> Inertial:
        """Return the body in the frame that T maps to."""
        R = T[:3, :3]
        return Inertial(self.mass_kg, R @ self.centre_m + T[:3, 3], R @ self.inertia_kg_m2 @ R.T)


def of_solid(solid: cq.Solid, density_g_cm3: float) -> Inertial:
    """Return the inertia of a homogeneous solid in mm."""
    kg_per_mm3, properties = density_g_cm3 * 1e-6, GProp_GProps()
    BRepGProp.VolumeProperties_s(solid.wrapped, properties)  # once: the same integral gives all three
    matrix = properties.MatrixOfInertia()
    inertia = np.array([[matrix.Value(i, j) for j in (1, 2, 3)] for i in (1, 2, 3)]) * kg_per_mm3 * 1e-6
    centre = np.array(properties.CentreOfMass().Coord()) / 1000
    return Inertial(properties.Mass() * kg_per_mm3, centre, (inertia + inertia.T) / 2)


def of_box(mass_g: float, low_mm: Iterable[float], high_mm: Iterable[float]) -> Inertial:
    """Return the inertia of a homogeneous box between two corners."""
    low, high = np.array(tuple(low_mm)) / 1000, np.array(tuple(high_mm)) / 1000
    x, y, z = (high - low) ** 2
    mass = mass_g / 1000
    return Inertial(mass, (low + high) / 2, mass / 12 * np.diag([y + z, z + x, x + y]))


def of_line(mass_g: float, points_mm: Array) -> Inertial:
    """Return the inertia of a thin homogeneous line through points, shape (n, 3)."""
    points = points_mm / 1000
    middles, lengths = (points[1:] + points[:-1]) / 2, np.linalg.norm(np.diff(points, axis=0), axis=1)
    masses = mass_g / 1000 * lengths / lengths.sum()
    centre = masses @ middles / masses.sum()
    d = middles - centre
    inertia = np.einsum("n,nk,nk->", masses, d, d) * np.eye(3) - np.einsum("n,ni,nj->ij", masses, d, d)
    return Inertial(mass_g / 1000, centre, inertia)


def together(bodies: Iterable[Inertial]) -> Inertial:
    """Return several bodies as one (Steiner)."""
    bodies = list(bodies)
    mass = sum(body.mass_kg for body in bodies)
    centre = sum((body.mass_kg * body.centre_m for body in bodies), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for body in bodies:
        d = body.centre_m - centre
        inertia += body.inertia_kg_m2 + body.mass_kg * (d @ d * np.eye(3) - np.outer(d, d))
    return Inertial(mass, centre, inertia)

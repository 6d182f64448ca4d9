"""Load of the emulated servo: the head as built, from the masses in `scanner.urdf`."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from scanwright.design import frames
from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Rotation, Vector
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import DeviceError
from scanwright.firmware_io.emulators.servo_plant import Load

_GRAVITY_M_S2 = np.array([0.0, 0.0, -frames.STANDARD_GRAVITY_M_S2])


def read_load(out: Path, angles: AngleSet) -> Load:
    """Return inertia and gravity of the links `rot` and `laser`; a light, balanced head without `scanner.urdf`."""
    file = out / "scanner.urdf"
    if not file.is_file():
        return Load()
    mass_kg, inertia_kg_m2, moment_kg_m = 0.0, 0.0, np.zeros(3)
    try:
        links = {link.get("name"): link for link in ElementTree.parse(file).getroot().findall("link")}
        for name, T_rot_link in (("rot", np.eye(4)), ("laser", angles.T_rot_laser())):
            link_kg, centre_m, link_kg_m2 = _inertial(links[name])
            centre_rot = frames.apply(T_rot_link, centre_m[None])[0]
            R = T_rot_link[:3, :3]
            mass_kg += link_kg
            moment_kg_m += link_kg * centre_rot
            inertia_kg_m2 += (R @ link_kg_m2 @ R.T)[2, 2] + link_kg * float(centre_rot[:2] @ centre_rot[:2])
    except (OSError, ElementTree.ParseError, KeyError, AttributeError, TypeError, ValueError) as error:
        raise DeviceError(f"{file}: no masses of the links rot and laser ({error}); run `build` again") from error
    g_rot = angles.T_world_rot(0.0)[:3, :3].T @ _GRAVITY_M_S2
    # The torque about the axis, (c x g')_z with gravity rotated by the negative joint angle, is a cosine of that angle.
    phase_rad = math.atan2(moment_kg_m[1], moment_kg_m[0]) - math.atan2(g_rot[1], g_rot[0]) + math.pi / 2
    return Load(
        inertia_kg_m2=float(inertia_kg_m2),
        gravity_nm=float(np.hypot(*moment_kg_m[:2]) * np.hypot(*g_rot[:2])),
        gravity_phase_rad=phase_rad,
        bearing_nm=_friction_nm(angles),
    )


def _friction_nm(angles: AngleSet) -> float:
    """Return the mean of the specified friction of the ring; that of a light bearing if it is unspecified."""
    ring = load_catalogue().products.get(angles.slip_ring or "")
    if not isinstance(ring, SlipRing) or ring.friction_nm is None:
        return Load().bearing_nm
    return sum(ring.friction_nm) / 2


def _inertial(link: ElementTree.Element) -> tuple[float, Vector, Rotation]:
    """Return mass [kg], centre [m] and inertia about it [kg m2], in the frame of the link."""
    inertial = link.find("inertial")
    mass_kg = float(inertial.find("mass").get("value"))  # type: ignore[union-attr, arg-type]
    centre_m = np.array(inertial.find("origin").get("xyz").split(), float)  # type: ignore[union-attr]
    J = inertial.find("inertia").attrib  # type: ignore[union-attr]
    xx, xy, xz, yy, yz, zz = (float(J[key]) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return mass_kg, centre_m, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

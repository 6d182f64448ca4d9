"""Bend of linkage and shaft by gravity, and the part of it that a calibration can correct.

Over a turn the lidar's rotation by its own weight has a part that is constant in the lidar's frame (an error of its
mount), a part that is constant in the world (an error of the axis), and a rest that changes with the servo's position.
`calibrate` estimates the first, the pose of the platform contains the second, the rest stays in the cloud. Servo, mount
and deck are rigid here: the lean of the mount is in `mount`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.masses import rotor_of
from scanwright.cad.checks.limits import at_most, tidy
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.layout.loads import FAR_MM, noise_deg
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.cad.statics.sag import Sag, linkage_sag, with_shaft
from scanwright.cad.statics.spring import Spring
from scanwright.design.arrays import Array
from scanwright.design.findings import Finding
from scanwright.design.scanner import Scanner

POSITIONS = 72  # of the servo, around a turn
LEAST_ERROR = 0.25  # share of the bend: a finer grid changed it by 3 % mostly, 22 % at worst, on seven mounts
FAILS_DEG = 1.0  # a constant bend up to this is a warning, since `calibrate` corrects it


@dataclass(frozen=True, slots=True)
class BeamError:
    """Largest over a turn: angle of the lidar [rad], and offset of a beam at FAR_MM [mm]."""

    angle_rad: float
    off_mm: float


def deflection_checks(
    scanner: Scanner, assembly: Assembly, bodies: Mapping[str, Inertial], meshes: Mapping[str, TriMesh]
) -> tuple[list[Finding], Spring | None]:
    """Check the constant part, which a calibration estimates, and the part that changes over a turn.

    Also returns the parts between hub and lidar as a spring, if they support the lidar; bodies of `masses.link_bodies`.
    """
    down = -scanner.angles.T_world_rot(0.0)[2, :3]
    limit = noise_deg(scanner)
    try:
        sag = sag_of(scanner, assembly, bodies, meshes)
    except RuntimeError as error:
        message = f"{ALIGNMENT_LINKAGE}: nothing supports the seat: no equilibrium by finite elements ({error})"
        return [Finding("deflection", "error", ALIGNMENT_LINKAGE, message, None, tidy(limit), "deg")], None
    constant, turning = split(sag.rotation_rad, sag.shift_m, down)
    errors = split(sag.rotation_error_rad, sag.shift_error_m, down)
    what = "bend of linkage and shaft by gravity, the same in every position: calibrate estimates it"
    fixed = _check("deflection", constant, errors[0], limit, what)
    if fixed.severity == "error" and fixed.value is not None and fixed.value <= FAILS_DEG:
        fixed = replace(fixed, severity="warning")
    what = "bend by gravity that changes over a turn, which no calibration corrects"
    return [fixed, _check("deflection_turning", turning, errors[1], limit, what)], sag.spring


def sag_of(scanner: Scanner, assembly: Assembly, bodies: Mapping[str, Inertial], meshes: Mapping[str, TriMesh]) -> Sag:
    """Return the sag of everything between horn and lidar; arguments as for `deflection_checks`."""
    layout, printer = assembly.layout, scanner.printer
    stack, linkage = layout.stack, layout.linkage
    seat = np.array([linkage.half_x, linkage.half_y, linkage.seat])
    printed = [meshes[name] for name in assembly.carriers()]
    sag = linkage_sag(stack, printed, seat, bodies["laser"], 1000 * printer.modulus_gpa, printer.density_g_cm3)
    return with_shaft(sag, layout.drive.bend, stack, rotor_of(scanner, bodies))


def split(rotation_rad: Array, shift_m: Array, down: Array) -> tuple[BeamError, BeamError]:
    """Return the constant part of a sag and the rest.

    Args:
        rotation_rad: per direction of gravity in the rotation frame, shape (3, 3).
        shift_m: likewise.
        down: unit vector of gravity in the rotation frame at gamma = 0.
    """
    gamma = 2 * np.pi * np.arange(POSITIONS) / POSITIONS
    turn = np.zeros((POSITIONS, 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(gamma)
    turn[:, 1, 0], turn[:, 2, 2] = np.sin(gamma), 1.0
    turn[:, 0, 1] = -np.sin(gamma)
    still = turn @ np.stack([rotation_rad, shift_m]).reshape(2, 1, 3, 3) @ turn.transpose(0, 2, 1) @ down
    basis = np.concatenate([turn, np.broadcast_to(np.eye(3), turn.shape)], axis=2).reshape(-1, 6)
    both = still.reshape(2, -1).T
    same = (basis @ np.linalg.lstsq(basis, both, rcond=None)[0]).T.reshape(still.shape)
    return _largest(same), _largest(still - same)


def _largest(parts: Array) -> BeamError:
    angle, shift = np.linalg.norm(parts, axis=2)
    return BeamError(float(angle.max()), float((angle * FAR_MM + 1000 * shift).max()))


def _check(code: str, bend: BeamError, error: BeamError, limit: float, what: str) -> Finding:
    value = round(math.degrees(bend.angle_rad), 6)  # zero is zero on every machine
    error_deg = round(math.degrees(max(error.angle_rad, LEAST_ERROR * bend.angle_rad)), 6)
    what = f"{what} ({bend.off_mm:.1f} mm at 10 m)"
    return at_most(code, value, limit, "deg", ALIGNMENT_LINKAGE, what, error_deg)

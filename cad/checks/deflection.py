"""What gravity does to the beams: how far lidar and shaft bend, and whether a calibration can take it away.

Over a turn the lidar's rotation by its own weight has a part that stays the same to the lidar (an error of its
mount), a part that stays the same in the room (an error of the axis), and a rest that changes with the servo's
position. `calibrate` finds the first, the pose of the platform holds the second, the rest stays in the cloud. Servo,
mount and deck are taken for rigid here: what a mount gives way is in `mount`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.masses import rotor_of
from scanwright.cad.checks.check import Check, Severity, tidy
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.layout.loads import FAR_MM, noise_deg
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE
from scanwright.cad.statics.sag import Sag, linkage_sag, with_shaft
from scanwright.design.arrays import Array
from scanwright.design.scanner import Scanner

POSITIONS = 72  # of the servo, around a turn
LEAST_ERROR = 0.25  # of the bend: what a grid of 4.8 or 4 mm still moved, 22 % at worst and mostly 3, on seven settings
HANGS_DEG = 1.0  # what bends more hangs on an edge


@dataclass(frozen=True, slots=True)
class BeamError:
    """Largest over a turn: angle of the lidar [rad], and how far that puts a beam off at FAR_MM [mm]."""

    angle_rad: float
    off_mm: float


def deflection_checks(
    scanner: Scanner, assembly: Assembly, bodies: Mapping[str, Inertial], meshes: Mapping[str, TriMesh]
) -> list[Check]:
    """The constant part, which a calibration finds, and the part that changes over a turn.

    Args:
        scanner: angles and products.
        assembly: its parts.
        bodies: of `masses.link_bodies`.
        meshes: of all parts.
    """
    down = -scanner.angles.T_world_rot(0.0)[2, :3]
    limit = noise_deg(scanner)
    try:
        sag = sag_of(scanner, assembly, bodies, meshes)
    except RuntimeError as error:
        message = f"{ALIGNMENT_LINKAGE}: nothing carries the seat: no equilibrium by finite elements ({error})"
        return [Check("deflection", "error", None, tidy(limit), "deg", ALIGNMENT_LINKAGE, message)]
    constant, turning = split(sag.rotation_rad, sag.shift_m, down)
    doubts = split(sag.rotation_error_rad, sag.shift_error_m, down)
    what = "the same in every position, for calibrate to find"
    found = _check(
        "deflection", constant, _at_least(doubts[0], constant), limit, f"bend of linkage and shaft by gravity, {what}"
    )
    if found.severity == "error" and found.value is not None and found.value <= HANGS_DEG:
        found = replace(found, severity="warning")
    what = "bend by gravity that changes over a turn, which no calibration takes away"
    return [found, _check("deflection_turning", turning, _at_least(doubts[1], turning), limit, what)]


def sag_of(scanner: Scanner, assembly: Assembly, bodies: Mapping[str, Inertial], meshes: Mapping[str, TriMesh]) -> Sag:
    """Of everything between horn and lidar; arguments as for `deflection_checks`."""
    layout, printer = assembly.layout, scanner.printer
    stack, linkage = layout.stack, layout.linkage
    seat = np.array([linkage.half_x, linkage.half_y, linkage.seat])
    printed = [meshes[name] for name in assembly.carriers()]
    sag = linkage_sag(stack, printed, seat, bodies["laser"], 1000 * printer.modulus_gpa, printer.density_g_cm3)
    return with_shaft(sag, layout.drive.bend, stack, rotor_of(scanner, bodies))


def split(rotation_rad: Array, shift_m: Array, down: Array) -> tuple[BeamError, BeamError]:
    """Constant part and the rest of a sag.

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


def _at_least(doubt: BeamError, part: BeamError) -> BeamError:
    return BeamError(max(doubt.angle_rad, LEAST_ERROR * part.angle_rad), max(doubt.off_mm, LEAST_ERROR * part.off_mm))


def _largest(parts: Array) -> BeamError:
    angle, shift = np.linalg.norm(parts, axis=2)
    return BeamError(float(angle.max()), float((angle * FAR_MM + 1000 * shift).max()))


def _check(kind: str, beams: BeamError, doubt: BeamError, limit: float, what: str) -> Check:
    """Fails over the limit, and warns where its error may put it there."""
    value = round(math.degrees(beams.angle_rad), 6)  # what is nothing is nothing on every machine
    error = round(math.degrees(doubt.angle_rad), 6)
    fails, may_fail = not value <= limit, not value + error <= limit  # what is no number fails
    message = (
        f"{ALIGNMENT_LINKAGE}: {what}: {value:.3g} +- {error:.1g} deg ({beams.off_mm:.1f} mm at 10 m), "
        f"{'over' if fails else 'may be over' if may_fail else 'of'} {limit:.3g}"
    )
    severity: Severity = "error" if fails else "warning" if may_fail else "pass"
    return Check(kind, severity, tidy(value), tidy(limit), "deg", ALIGNMENT_LINKAGE, message)

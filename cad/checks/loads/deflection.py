"""Bend of linkage and shaft by gravity, lean of the mount, and the first natural frequency.

Over a turn the lidar's rotation by its own weight has a part that is constant in the lidar's frame (an error of its
mount), a part that is constant in the world (an error of the axis), and a rest that changes with the servo's position.
`calibrate` estimates the first, the pose of the platform contains the second, the rest stays in the cloud. Servo, mount
and deck are rigid here. The lean of the mount under its load is an error of the scanner's pose that no cloud shows, the
same in every position of the servo (to 0.0001 deg, `benchmarks.cad.elements`).

The frequency is that of a row of rigid bodies on springs: servo and fixed parts on the mount, hub on the shaft, lidar
on the linkage. Linkage and mount are finite elements, the shaft is a beam, horn or bearing seats are springs. The deck
is rigid and holds the mount by its screws alone; servo frame, tower and tripod foot are rigid; the servo keeps its
position.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from scanwright.cad.assembly.assembly import Assembly, link_bodies, rotor_of
from scanwright.cad.checks.table import FREQUENCY_RATIO, LEAN_DEG, at_most, figures, tidy
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.loads import FAR_MM, noise_deg
from scanwright.cad.layout.names import ALIGNMENT_LINKAGE, BASE_MOUNT, LIDAR, TRIPOD_FOOT
from scanwright.cad.parts.mounts.base_mount import FOOT_RADIUS
from scanwright.cad.screws import passing_hole
from scanwright.cad.statics.sag import Carried, Sag, linkage_sag, mount_sag, with_shaft
from scanwright.cad.statics.spring import Spring, SpringRow, mass_matrix, of_shaft, row_of
from scanwright.design.arrays import Array
from scanwright.design.findings import Finding, Severity
from scanwright.design.scanner import Scanner

POSITIONS = 72  # of the servo, around a turn
LEAST_ERROR = 0.25  # share of the bend: a finer grid changed it by 3 % mostly, 22 % at worst, on seven mounts
LEAN_ERROR = 0.4  # share of a mount's lean: CalculiX differs by 19 % at most (`benchmarks.cad.elements`)
LEAN_LEAST_DEG = 0.001  # error of the lean of a centred load: CalculiX differs by 0.0004 deg
FAILS_DEG = 1.0  # a constant bend up to this is a warning, since `calibrate` corrects it
WASHER_MM = 4.0  # a deck screw's washer extends so far beyond its hole
ERROR = 0.15  # of the frequency: CalculiX differs by 7 % at most on 16 scanners (`benchmarks.cad.vibration`)
AT_M = 5.0  # from the lidar, where the message states an amplitude
LOSS = 0.04  # of printed plastic, energy lost per radian over energy stored: assumed
GRADE_M_S = 6.3e-3  # residual imbalance of small motors, G 6.3 of ISO 21940-11
MIRROR_SHARE = 0.05  # of the lidar's mass that turns in it: assumed


@dataclass(frozen=True, slots=True)
class BeamError:
    """Largest over a turn: angle of the lidar [rad], and offset of a beam at FAR_MM [mm]."""

    angle_rad: float
    off_mm: float


def bending_checks(assembly: Assembly) -> list[Finding]:
    """Check the bend of linkage and shaft, the lean of the mount, and the first natural frequency."""
    bodies = link_bodies(assembly)
    bent, linkage = deflection_checks(assembly, bodies)
    leans, mount = mount_checks(assembly, bodies)
    return [*bent, *leans, *([] if linkage is None else [vibration_check(assembly, bodies, linkage, mount)])]


def deflection_checks(assembly: Assembly, bodies: Mapping[str, Inertial]) -> tuple[list[Finding], Spring | None]:
    """Check the constant part, which a calibration estimates, and the part that changes over a turn.

    Also returns the parts between hub and lidar as a spring, if they support the lidar; bodies of `link_bodies`.
    """
    scanner = assembly.layout.scanner
    down = -scanner.angles.T_world_rot(0.0)[2, :3]
    limit = noise_deg(scanner)
    try:
        sag = sag_of(assembly, bodies)
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


def sag_of(assembly: Assembly, bodies: Mapping[str, Inertial]) -> Sag:
    """Return the sag of everything between horn and lidar; bodies of `link_bodies`."""
    layout, printer = assembly.layout, assembly.layout.scanner.printer
    stack, linkage = layout.stack, layout.linkage
    seat = np.array([linkage.half_x, linkage.half_y, linkage.seat])
    printed = [assembly.mesh(name) for name in assembly.carriers()]
    sag = linkage_sag(stack, printed, seat, bodies["laser"], 1000 * printer.modulus_gpa, printer.density_g_cm3)
    return with_shaft(sag, layout.drive.bend, stack, rotor_of(layout.scanner, bodies))


def split(rotation_rad: Array, shift_m: Array, down: Array) -> tuple[BeamError, BeamError]:
    """Return the constant part of a sag and the rest.

    Rotation and shift are per direction of gravity, rotation frame, shape (3, 3); `down` is gravity at gamma = 0.
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


def mount_checks(assembly: Assembly, bodies: Mapping[str, Inertial]) -> tuple[list[Finding], Spring | None]:
    """Check the lean of a scanner on its mount, and return the mount as a spring, if it has one."""
    if BASE_MOUNT not in assembly.made:
        return [], None
    layout, load = assembly.layout, carried(assembly, bodies)
    printer, mesh = layout.scanner.printer, assembly.mesh(BASE_MOUNT)
    material = 1000 * printer.modulus_gpa, printer.density_g_cm3
    try:
        turned, more, spring = mount_sag(mesh, layout.deck, layout.drive.mounted, load, *material)
    except RuntimeError as error:
        message = f"{BASE_MOUNT}: nothing supports its load: no equilibrium by finite elements ({error})"
        return [Finding("mount_lean", "error", BASE_MOUNT, message, None, LEAN_DEG, "deg")], None
    lean = np.degrees(layout.scanner.angles.T_world_rot(0.0)[:3, :3] @ turned)
    value = round(float(np.linalg.norm(lean)), 6)
    error_deg = max(math.degrees(float(np.linalg.norm(more))), LEAN_ERROR * value, LEAN_LEAST_DEG)
    severity: Severity = "note" if value + error_deg <= LEAN_DEG else "warning"
    x, y, z = (f"{round(float(part), 3) + 0.0:g}" for part in lean)
    message = (
        f"{BASE_MOUNT}: leans under its load by {value:.2g} ± {error_deg:.1g} deg if only its screws hold it, less if "
        f"the deck supports its foot: in every position it turns the scanner by ({x}, {y}, {z}) deg about the world's "
        "x, y and z"
    )
    hint = "add this rotation to the scanner's pose on the robot"
    return [Finding("mount_lean", severity, BASE_MOUNT, message, tidy(value), LEAN_DEG, "deg", hint)], spring


def carried(assembly: Assembly, bodies: Mapping[str, Inertial]) -> Carried:
    """Return all above the mount, its rotor spread about the axis; bodies of `link_bodies`."""
    scanner = assembly.layout.scanner
    rotor, fixed = rotor_of(scanner, bodies), bodies["servo"]
    below = [assembly.inertial(name) for name in (BASE_MOUNT, TRIPOD_FOOT) if name in assembly.made]
    shares = [
        (fixed.mass_kg, fixed.centre_m),
        (rotor.mass_kg, rotor.centre_m * [0.0, 0.0, 1.0]),
        *((-body.mass_kg, body.centre_m) for body in below),
    ]
    mass = sum(share for share, _ in shares)
    centre = sum((share * at for share, at in shares), np.zeros(3)) / mass
    return Carried(
        mass_kg=mass,
        centre_m=centre,
        down=-scanner.angles.T_world_rot(0.0)[2, :3],
        seat_mm=FOOT_RADIUS,
        washer_mm=passing_hole(assembly.layout.deck.screw, scanner.printer) / 2 + WASHER_MM,
    )


def vibration_check(
    assembly: Assembly, bodies: Mapping[str, Inertial], linkage: Spring, mount: Spring | None
) -> Finding:
    """Check the first natural frequency; `linkage` is from hub to lidar, `mount` from deck to servo."""
    scanner, lidar = assembly.layout.scanner, assembly.layout.scanner.lidar
    row = row_of_scanner(assembly, bodies, linkage, mount)
    first, mirror = float(row.frequencies_hz()[0]), lidar.scan_rate_hz
    limit = FREQUENCY_RATIO * mirror
    parts = "linkage, shaft and servo" if mount is None else "linkage, shaft, servo and mount"
    message = (
        f"{LIDAR}: first natural frequency of {parts}: {figures(first)} ± {figures(ERROR * first)} Hz (at least "
        f"{figures(limit)}: {FREQUENCY_RATIO:g} times the mirror of {lidar.name}, {mirror:g} Hz)"
    )
    severity: Severity = "ok" if first >= limit else "warning"
    hint = ""
    if first < limit:
        hint = "print linkage and mount of a stiffer plastic, or take a lighter lidar or a shorter ring"
        message += (
            f"; a beam moves by up to {1000 * amplitude_m(row, scanner):.2g} mm at {AT_M:g} m, if a mirror of "
            f"{MIRROR_SHARE:.0%} of the lidar's mass is balanced to G {1000 * GRADE_M_S:g} (assumed)"
        )
    return Finding("natural_frequency", severity, LIDAR, message, tidy(round(first, 3)), tidy(limit), "Hz", hint)


def row_of_scanner(
    assembly: Assembly, bodies: Mapping[str, Inertial], linkage: Spring, mount: Spring | None
) -> SpringRow:
    """Return the scanner as bodies on springs; arguments as for `vibration_check`.

    What turns besides linkage and lidar counts half for the hub, half for the horn: a beam's ends.
    """
    carriers = sum((mass_matrix(assembly.inertial(name)) for name in assembly.carriers()), np.zeros((6, 6)))
    shaft = (mass_matrix(bodies["rot"]) - carriers) / 2
    springs = [of_shaft(assembly.layout.drive.gives, assembly.layout.stack.shoulder), linkage]
    masses = [shaft, mass_matrix(bodies["laser"].moved(assembly.layout.scanner.angles.T_rot_laser()))]
    if mount is not None:
        fixed = mass_matrix(bodies["servo"]) - mass_matrix(assembly.inertial(BASE_MOUNT))
        springs, masses = [mount, *springs], [fixed + shaft, *masses]
    return row_of(springs, masses)


def amplitude_m(row: SpringRow, scanner: Scanner) -> float:
    """Return the amplitude of a beam at AT_M by the mirror, the largest within the error of the frequency."""
    lidar, R = scanner.lidar, scanner.angles.R_rot_laser()
    kg, hz = MIRROR_SHARE * lidar.mass_g / 1000, lidar.scan_rate_hz
    turns = R @ np.array([1.0, -1.0j, 0.0])  # in the scan plane

    def moves(share: float) -> float:
        moved: Array = np.abs(row.moved(np.concatenate([np.zeros(3), turns]), share * hz, LOSS))
        return float(AT_M * np.linalg.norm(moved[:3]) + np.linalg.norm(moved[3:]))

    return kg * GRADE_M_S * 2 * np.pi * hz * max(map(moves, np.linspace(1 - ERROR, 1 + ERROR, 31)))

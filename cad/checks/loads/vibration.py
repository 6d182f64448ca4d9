"""First natural frequency of all that carries the lidar, and the motion of a beam by the lidar's mirror.

A row of rigid bodies on springs: servo and fixed parts on the mount, hub on the shaft, lidar on the linkage. Linkage
and mount are finite elements, the shaft is a beam, horn or bearing seats are springs. The deck is rigid and holds the
mount by its screws alone; servo frame, tower and tripod foot are rigid; the servo keeps its position.
"""

from collections.abc import Mapping

import numpy as np

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.checks.limits import figures, tidy
from scanwright.cad.checks.table import FREQUENCY_RATIO
from scanwright.cad.geometry.inertia import Inertial
from scanwright.cad.layout.names import BASE_MOUNT, LIDAR
from scanwright.cad.statics.spring import Spring, of_shaft
from scanwright.cad.statics.vibration import SpringRow, mass_matrix, row_of
from scanwright.design.arrays import Array
from scanwright.design.findings import Finding, Severity
from scanwright.design.scanner import Scanner

ERROR = 0.15  # of the frequency: CalculiX differs by less (`benchmarks.cad.vibration`)
AT_M = 5.0  # from the lidar, where the message states an amplitude
LOSS = 0.04  # of printed plastic, energy lost per radian over energy stored: assumed
GRADE_M_S = 6.3e-3  # residual imbalance of small motors, G 6.3 of ISO 21940-11
MIRROR_SHARE = 0.05  # of the lidar's mass that turns in it: assumed


def vibration_checks(
    scanner: Scanner, assembly: Assembly, bodies: Mapping[str, Inertial], linkage: Spring, mount: Spring | None
) -> list[Finding]:
    """Check the first natural frequency; `linkage` is from hub to lidar, `mount` from deck to servo."""
    lidar = scanner.lidar
    row = row_of_scanner(scanner, assembly, bodies, linkage, mount)
    first, mirror = float(row.frequencies_hz()[0]), lidar.scan_rate_hz
    limit = FREQUENCY_RATIO * mirror
    parts = "linkage, shaft and servo" if mount is None else "linkage, shaft, servo and mount"
    message = (
        f"{LIDAR}: first natural frequency of {parts}: {figures(first)} ± {figures(ERROR * first)} Hz (at least "
        f"{figures(limit)}: {FREQUENCY_RATIO:g} times the mirror of {lidar.name}, {mirror:g} Hz)"
    )
    severity: Severity = "ok"
    hint = ""
    if first < limit:
        severity, hint = (
            "warning",
            "print linkage and mount with more infill, or take a lighter lidar or a shorter ring",
        )
        message += (
            f"; a beam moves by up to {1000 * amplitude_m(row, scanner):.2g} mm at {AT_M:g} m, if a mirror of "
            f"{MIRROR_SHARE:.0%} of the lidar's mass is balanced to G {1000 * GRADE_M_S:g} (assumed)"
        )
    return [Finding("natural_frequency", severity, LIDAR, message, tidy(round(first, 3)), tidy(limit), "Hz", hint)]


def row_of_scanner(
    scanner: Scanner, assembly: Assembly, bodies: Mapping[str, Inertial], linkage: Spring, mount: Spring | None
) -> SpringRow:
    """Return the scanner as bodies on springs; arguments as for `vibration_checks`.

    What turns besides linkage and lidar counts half for the hub, half for the horn: a beam's ends.
    """
    carriers = sum((mass_matrix(assembly.inertial(name)) for name in assembly.carriers()), np.zeros((6, 6)))
    shaft = (mass_matrix(bodies["rot"]) - carriers) / 2
    springs = [of_shaft(assembly.layout.drive.gives, assembly.layout.stack.hub_bottom), linkage]
    masses = [shaft, mass_matrix(bodies["laser"].moved(scanner.angles.T_rot_laser()))]
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

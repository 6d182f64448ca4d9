"""How many scanners of random angles build and pass every check, and what their parts come to.

    python -m benchmarks.cad.parts [SETTINGS] [SENSOR] [SERVO]

Angle pairs of the lidar are `default_rng(1).uniform(-90, 90, (300, 2))`, those of the prototype study; every one gets
a random place of the axis. For each setting: all parts and all checks of `scanwright check`; a failed check counts with
its kind, a setting that cannot be built with its reason. Masses are of printed parts, filled; a part or a check that
only some settings have is counted over these. Ctrl-C ends a run early and tells what it has measured.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from contextlib import suppress

import numpy as np

from cad.assembly.make import make_parts
from cad.assembly.masses import link_bodies
from cad.checks.check import Check
from cad.checks.run import run_checks
from cad.geometry.inertia import of_solid
from design.angles import Angles, AngleSet
from design.catalogue.catalogue import load_catalogue
from design.errors import BuildError
from design.scanner import Scanner, scanner_of

RING = "UH1256-02-0610-06S"
TOLD = ("beams_hidden", "beams_linkage", "tilt_moment", "shaft_slope", "deflection", "deflection_turning")


def main(count: int = 300, sensor: str = "UTM-30LX", servo: str = "MX-64R") -> None:
    """Build, check, and print the table."""
    catalogue = load_catalogue()
    lasers = np.random.default_rng(1).uniform(-90, 90, (300, 2))
    axes = np.random.default_rng(2).uniform((-180, -90), (180, 90), (300, 2))
    rows: list[dict[str, float]] = []
    failed: Counter[str] = Counter()
    warned: Counter[str] = Counter()
    refused: list[str] = []
    passed = 0
    with suppress(KeyboardInterrupt):
        for setting in np.column_stack([axes, lasers])[:count]:
            alpha_rot, beta_rot, alpha, beta = (round(float(angle), 2) for angle in setting)
            angles = AngleSet(
                task="benchmark",
                angles_deg=Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha, beta_laser=beta),
                sensor=sensor,
                servo=servo,
                slip_ring=RING,
            )
            start = time.perf_counter()
            try:
                values, checks = _measured(scanner_of(angles, "fdm-0.4", catalogue))
            except BuildError as error:
                refused.append(f"{alpha_rot, beta_rot, alpha, beta}: {error}")
                print("refused", refused[-1])
                continue
            values["seconds"] = time.perf_counter() - start
            rows.append(values)
            faults = [check for check in checks if check.severity == "error"]
            passed += not faults
            failed.update({check.kind for check in faults})
            warned.update({check.kind for check in checks if check.severity == "warning"})
            for check in faults:
                print(f"failed {alpha_rot, beta_rot, alpha, beta}: {check.message}")
    done = len(rows) + len(refused)
    print(f"{sensor} on {servo}: {done} settings, {len(rows)} built, {passed} pass every check, {len(refused)} refused")
    print("  failed: ", ", ".join(f"{kind} {n}" for kind, n in failed.most_common()) or "none")
    print("  warned: ", ", ".join(f"{kind} {n}" for kind, n in warned.most_common()) or "none")
    for name in dict.fromkeys(name for row in rows for name in row):
        low, middle, high, top = np.quantile([row[name] for row in rows if name in row], [0, 0.5, 0.95, 1])
        print(f"  {name:<20} min {low:8.3f}  median {middle:8.3f}  p95 {high:8.3f}  max {top:8.3f}")


def _measured(scanner: Scanner) -> tuple[dict[str, float], list[Check]]:
    """What the parts of one scanner come to, and their checks.

    Raises:
        BuildError: a part cannot be made.
    """
    assembly = make_parts(scanner)
    checks, _ = run_checks(scanner, assembly, lambda _: None)
    found = {check.kind: check.value for check in checks if check.value is not None}
    density = scanner.printer.density_g_cm3
    printed = {
        f"{name}_g": 1000 * of_solid(solid, density).mass_kg
        for name, solid in assembly.made.items()
        if not assembly.parts[name].metal
    }
    values = {
        "h_mm": assembly.layout.stack.h,
        **printed,
        "printed_g": sum(printed.values()),
        "rotor_g": 1000 * link_bodies(scanner, assembly)["rot"].mass_kg,
        "bearing": float(assembly.layout.stack.bearing is not None),
        "sub_plate": float(assembly.layout.stack.sub_plate is not None),
        "counterweight": float("counterweight" in assembly.made),
        "imbalance_nm": found["flanks"],
        "thin_wall_mm2": max((check.value or 0.0 for check in checks if check.kind == "wall"), default=0.0),
        "islands": max((check.value or 0.0 for check in checks if check.kind == "islands"), default=0.0),
    }
    return values | {kind: found[kind] for kind in TOLD if kind in found}, checks


if __name__ == "__main__":
    main(*(int(argument) if argument.isdigit() else argument for argument in sys.argv[1:]))  # type: ignore[arg-type]

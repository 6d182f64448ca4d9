"""How many scanners of random angles build and pass every check, and what their parts come to.

    python -m benchmarks.cad.parts [SETTINGS] [SENSOR SERVO RING]

Angle pairs of the lidar are `default_rng(1).uniform(-90, 90, (300, 2))`, those of the prototype study; every one gets
a random place of the axis, and without products in its turn one of six combinations of them. For each setting: all
parts and all checks of `scanwright check`; a failed check counts with its kind, a setting that cannot be built with its
reason. A part or a check that only some settings have is counted over these. Where PrusaSlicer is installed, the parts
of one setting of each twenty-five are sliced. Ctrl-C ends a run early and tells what it has measured.
"""

from __future__ import annotations

import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from benchmarks.cad import slicer
from scanwright.cad.assembly.assembly import Assembly, link_bodies
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.assembly.print_settings import slicer_settings
from scanwright.cad.checks.run import run_checks
from scanwright.cad.files.plates import threemf_bytes
from scanwright.cad.geometry.inertia import of_solid
from scanwright.cad.geometry.print_pose import on_bed
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import BuildError
from scanwright.design.findings import Finding
from scanwright.design.progress import no_progress
from scanwright.design.scanner import Scanner, scanner_of

Products = tuple[str, str, str]
BORE, BORE_TOO, CAPSULE = "UH1256-02-0610-06S", "SNU11-P0210", "SRC022A-6"
COMBINATIONS: tuple[Products, ...] = (
    ("UTM-30LX", "MX-64R", BORE),
    ("UST-10LX", "MX-106", BORE_TOO),
    ("URG-04LX", "AX-12A", BORE),
    ("LD19", "MX-28", BORE),
    ("UTM-30LX", "MX-106", CAPSULE),
    ("UST-10LX", "MX-28", CAPSULE),
)
SLICED = 25  # one setting of so many of each combination
WORST = {  # what a table holds of all checks of one kind
    "wall": max,
    "islands": max,
    "retention": min,
    "lead_bend": min,
    "lead_length": max,
    "beams_hidden": max,
    "beams_linkage": max,
    "tilt_moment": max,
    "shaft_slope": max,
    "deflection": max,
    "deflection_turning": max,
    "mount_lean": max,
    "clearance": min,
}


@dataclass(frozen=True, slots=True)
class Made:
    """What one setting came to.

    Attributes:
        which: its products.
        setting: products and angles in words.
        refused: why it cannot be built; empty where it can.
        values: masses, and the worst of its checks of each kind.
        failed: kind and message of each check that failed.
        warned: kinds of the checks that warn.
    """

    which: Products
    setting: str
    refused: str = ""
    values: Mapping[str, float] = field(default_factory=dict)
    failed: tuple[tuple[str, str], ...] = ()
    warned: frozenset[str] = frozenset()


def main(count: int = 300, *products: str) -> None:
    """Build, check, and print the table."""
    combinations: tuple[Products, ...] = ((products[0], products[1], products[2]),) if products else COMBINATIONS
    made: list[Made] = []
    settings = enumerate(scanners_of(combinations, count))
    with get_context("spawn").Pool(initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_IGN)) as pool:
        with suppress(KeyboardInterrupt):
            for one in pool.imap(partial(_made, combinations), settings):
                made.append(one)
                for kind, text in (*[("refused", one.refused)] * bool(one.refused), *one.failed):
                    print(f"{len(made)}: {kind}: {one.setting}: {text}", flush=True)
        pool.terminate()
    for which in combinations:
        print(f"{' '.join(which)}: {_counts([one for one in made if one.which == which])}")
    print(_counts(made))
    built = [one for one in made if not one.refused]
    failed = Counter(kind for one in built for kind in {kind for kind, _ in one.failed})
    print("  failed: ", ", ".join(f"{kind} {n}" for kind, n in failed.most_common()) or "none")
    warned = Counter(kind for one in built for kind in one.warned)
    print("  warned: ", ", ".join(f"{kind} {n}" for kind, n in warned.most_common()) or "none")
    for name in dict.fromkeys(name for one in built for name in one.values):
        found = [one.values[name] for one in built if name in one.values]
        low, middle, high, top = np.quantile(found, [0, 0.5, 0.95, 1])
        print(f"  {name:<22} of {len(found):<3} min {low:8.3f}  median {middle:8.3f}  p95 {high:8.3f}  max {top:8.3f}")


def _counts(made: Sequence[Made]) -> str:
    built = [one for one in made if not one.refused]
    passed = sum(not one.failed for one in built)
    return f"{len(made)} settings, {len(built)} built, {passed} pass every check, {len(made) - len(built)} refused"


def _made(combinations: tuple[Products, ...], numbered: tuple[int, Scanner]) -> Made:
    number, scanner = numbered
    which, start = combinations[number % len(combinations)], time.process_time()
    setting = f"{' '.join(which)} {tuple(scanner.angles.angles_deg.model_dump().values())}"
    try:
        assembly = make_parts(scanner)
        checks, _ = run_checks(assembly, no_progress)
    except BuildError as error:
        return Made(which, setting, refused=str(error))
    values = _values(scanner, assembly, checks) | {"processor_s": time.process_time() - start}
    if (number // len(combinations)) % SLICED == 0 and shutil.which(slicer.PROGRAM):
        values |= _sliced(scanner, assembly)
    failed = tuple((check.code, check.message) for check in checks if check.severity == "error")
    warned = frozenset(check.code for check in checks if check.severity == "warning")
    return Made(which, setting, values=values, failed=failed, warned=warned)


def scanners_of(combinations: tuple[Products, ...], count: int) -> Iterator[Scanner]:
    """One of each setting, with the combinations in turn."""
    catalogue = load_catalogue()
    lasers = np.random.default_rng(1).uniform(-90, 90, (300, 2))
    axes = np.random.default_rng(2).uniform((-180, -90), (180, 90), (300, 2))
    for number, setting in enumerate(np.column_stack([axes, lasers])[:count]):
        sensor, servo, ring = combinations[number % len(combinations)]
        alpha_rot, beta_rot, alpha, beta = (round(float(angle), 2) for angle in setting)
        angles = AngleSet(
            task="benchmark",
            angles_deg=Angles(alpha_rot=alpha_rot, beta_rot=beta_rot, alpha_laser=alpha, beta_laser=beta),
            sensor=sensor,
            servo=servo,
            slip_ring=ring,
        )
        yield scanner_of(angles, "fdm-0.4", catalogue)


def _values(scanner: Scanner, assembly: Assembly, checks: list[Finding]) -> dict[str, float]:
    """What the parts of one scanner come to, and the worst of its checks of each kind."""
    density = scanner.printer.density_g_cm3
    printed = {
        f"{name}_g": 1000 * of_solid(solid, density).mass_kg
        for name, solid in assembly.made.items()
        if not assembly.parts[name].metal
    }
    found = {
        kind: worst(check.value for check in checks if check.code == kind and check.value is not None)
        for kind, worst in WORST.items()
        if any(check.code == kind and check.value is not None for check in checks)
    }
    # how much of what the horn may bear it does bear
    horn = [
        check.value / check.limit for check in checks if check.code == "tilt_moment" and check.value and check.limit
    ]
    return {
        "h_mm": assembly.layout.stack.h,
        **printed,
        "printed_g": sum(printed.values()),
        "rotor_g": 1000 * link_bodies(assembly)["rot"].mass_kg,
        "bearing": float(assembly.layout.stack.bearing is not None),
        "sub_plate": float(assembly.layout.stack.sub_plate is not None),
        "counterweight": float("counterweight" in assembly.made),
        "leads": float(len(assembly.layout.leads)),
        "leads_laid": float(sum(lead.path is not None for lead in assembly.layout.leads)),
        **({"horn_share": max(horn)} if horn else {}),
        **found,
    }


def _sliced(scanner: Scanner, assembly: Assembly) -> dict[str, float]:
    """Hours of printing, of the longest part and of all of them, without labels."""
    hours = {}
    for name, part in assembly.parts.items():
        if part.metal or name not in assembly.made:
            continue
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / f"{name}.3mf"
            mesh = on_bed(assembly.mesh(name), assembly.print_pose(name))
            file.write_bytes(threemf_bytes({name: mesh}, name, "", slicer_settings(scanner.printer)))
            hours[f"{name}_h"] = slicer.sliced(file).time_s / 3600
    return {**hours, "longest_h": max(hours.values()), "printed_h": sum(hours.values())}


if __name__ == "__main__":
    main(*(int(argument) if argument.isdigit() else argument for argument in sys.argv[1:]))  # type: ignore[arg-type]

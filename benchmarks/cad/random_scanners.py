"""Random scanners of all that go together: `python -m benchmarks.cad.random_scanners COUNT [SEED [FIRST]]`.

Takes COUNT of all combinations of lidar, servo and ring, in a random order, from number FIRST on (1 if not given), so
that several runs share the work or go on with it. Those that `benchmarks.cad.combinations` lays out are made and
checked in memory as a build does it, with random attitude, printer and modules. One line for each that does not pass,
then how many passed, were refused (reasons counted), failed loudly (with which checks), and failed silently: an
exception that is no BuildError, or all checks passed and this script, which reads the solids and records itself, still
finds a fault. Ctrl-C ends the run with the totals so far. Exit code 1 if one failed silently.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import sys
from collections import Counter
from collections.abc import Iterator

import numpy as np

from benchmarks.cad.combinations import TILTED, general, laid_out_at, screws_without_a_hole
from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.make import make_parts
from scanwright.cad.checks.run import run_checks
from scanwright.cad.layout.names import TRIPOD_FOOT
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import Catalogue, load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.products import Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import BuildError
from scanwright.design.findings import errors_in
from scanwright.design.progress import no_progress
from scanwright.design.scanner import Modules, Scanner, scanner_of

FOOT_SHARE = 0.1  # of the scanners that require a tripod foot
SOLID_MM3 = 1.0  # less than any part
Products = tuple[str, str, str | None]


def shuffled(catalogue: Catalogue, rng: np.random.Generator) -> list[Products]:
    """Return every lidar with every servo and ring, or no ring, in a random order."""
    lidars, servos, rings = (
        [one.name for one in catalogue if isinstance(one, kind)] for kind in (Lidar, Servo, SlipRing)
    )
    every = list(itertools.product(lidars, servos, [None, *rings]))
    return [every[i] for i in rng.permutation(len(every))]


def _fits(catalogue: Catalogue, lidar: str, servo: str, ring: str | None) -> bool:
    for angles in (TILTED, (0.0, 0.0, 0.0, 0.0)):
        with contextlib.suppress(BuildError):
            laid_out_at(catalogue, angles, lidar, servo, ring)
            return True
    return False


def scanners(catalogue: Catalogue, seed: int, first: int = 1) -> Iterator[tuple[int, Scanner | None]]:
    """Yield the number of each combination from one on, and its scanner; None if it cannot be laid out."""
    every = shuffled(catalogue, np.random.default_rng(seed))
    for number, products in enumerate(every[first - 1 :], start=first):
        fits = _fits(catalogue, *products)
        yield number, random_scanner(catalogue, products, np.random.default_rng((seed, number))) if fits else None


def random_scanner(catalogue: Catalogue, products: Products, rng: np.random.Generator) -> Scanner:
    """Return a scanner of these products: a random axis, and a lidar that does not hang upside down over it."""
    lidar, servo, ring = products
    alpha_rot, beta_rot = rng.choice(
        [(0.0, 0.0), (0.0, 90.0), tuple(rng.uniform(-180, 180, 2) * [1.0, 0.5])], p=[0.25, 0.15, 0.6]
    )
    chosen = AngleSet(
        task="random",
        angles_deg=Angles(
            alpha_rot=round(float(alpha_rot), 2),
            beta_rot=round(float(beta_rot), 2),
            alpha_laser=round(float(rng.uniform(-89, 89)), 2),
            beta_laser=round(float(rng.uniform(-89, 89)), 2),
        ),
        sensor=lidar,
        servo=servo,
        slip_ring=ring,
        motion={"mode": "spin", "period_s": 10.0}
        if ring
        else {"mode": "sweep", "limits_deg": [-90, 90], "period_s": 10.0},
    )
    printers = [one.name for one in catalogue if isinstance(one, Printer)]
    modules = Modules(tripod_foot=bool(rng.random() < FOOT_SHARE))
    return scanner_of(chosen, str(rng.choice(printers)), catalogue, modules=modules)


def described(scanner: Scanner) -> str:
    """Return the products, angles and printer of a scanner."""
    angles, ring = scanner.angles.angles_deg, scanner.slip_ring
    at = f"({angles.alpha_rot:g}, {angles.beta_rot:g}, {angles.alpha_laser:g}, {angles.beta_laser:g})"
    products = f"{scanner.lidar.name} {scanner.servo.name} {ring.name if ring else None}"
    return f"{products} at {at} on {scanner.printer.name}"


def silent_faults(scanner: Scanner, assembly: Assembly) -> Iterator[str]:
    """Yield what no check has reported, from solids and records."""
    for name, solid in assembly.made.items():
        if not solid.isValid() or len(solid.Solids()) != 1 or solid.Volume() < SOLID_MM3:
            yield f"{name} is no valid solid"
    if scanner.modules.tripod_foot and TRIPOD_FOOT not in assembly.made:
        yield f"{TRIPOD_FOOT} is required and missing"
    yield from screws_without_a_hole(assembly.layout)


def main(count: int, seed: int = 0, first: int = 1) -> None:
    """Print the lines."""
    catalogue = load_catalogue()
    outcomes, refused, failed = Counter[str](), Counter[str](), Counter[str]()
    last = first - 1
    with contextlib.suppress(KeyboardInterrupt):
        for number, scanner in itertools.islice(scanners(catalogue, seed, first), count):
            outcome, line = "not laid out", ""
            if scanner is not None:
                outcome, words = _outcome(scanner, refused, failed)
                line = f"{described(scanner)}: {outcome}: {words}"
            outcomes[outcome] += 1
            last = number
            if outcome not in ("passed", "not laid out"):
                print(f"{number} {line}", flush=True)
    print(f"combinations {first} to {last}, seed {seed}: {dict(outcomes)}")
    for title, counts in (("refused", refused), ("failed", failed)):
        for reason, n in counts.most_common():
            print(f"  {title} {n}: {reason}")
    sys.exit(bool(outcomes["silent"]))


def _outcome(scanner: Scanner, refused: Counter[str], failed: Counter[str]) -> tuple[str, str]:
    """Make and check one scanner."""
    try:
        assembly = make_parts(scanner)
        checks = run_checks(assembly, no_progress)[0]
    except BuildError as error:
        refused[general(str(error), scanner.lidar.name)] += 1
        return "refused", str(error)
    except Exception as error:  # any other one is what is looked for
        return "silent", f"{type(error).__name__}: {error}"
    errors = errors_in(checks)
    failed.update({check.code for check in errors})
    if errors:
        return "loud", "; ".join(check.message for check in errors)
    faults = [f"{check.code}: {check.value}" for check in checks if not math.isfinite(check.value or 0.0)]
    faults += silent_faults(scanner, assembly)
    return ("silent", "; ".join(faults)) if faults else ("passed", "")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:4]))

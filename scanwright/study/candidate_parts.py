"""Everything that decides about one candidate from its solids: what they hide, weigh, bear, bend and cost."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from cad.assembly.shadow import PartsWorkshop, at_setting
from cad.kernel import require_kernel
from design.errors import BuildError
from design.frames import Array
from design.scanner import Scanner
from design.search.with_parts import Refused
from design.shadow import Shadow
from design.task.task import LoadedTask
from scanwright.study.candidate import PartFacts, judged
from scanwright.study.runner.store import Result

if TYPE_CHECKING:
    from cad.assembly.assembly import Assembly
    from cad.checks.check import Check

LOADS = ("static_torque", "spin_up_torque", "tilt_moment", "axial_load", "bearing_load")
BENDS = "deflection"  # of linkage and shaft, by finite elements


def judge(loaded: LoadedTask, found: Result) -> Result:
    """The result of one candidate; see `scanwright.study.candidate.judged`."""
    require_kernel("study")
    return judged(loaded, found, PartsBench)


class PartsBench:
    """The `Bench` of one set of products: makes the parts of a setting once, and refuses it where a check fails."""

    def __init__(self, scanner: Scanner) -> None:
        self._scanner = scanner
        self._made: dict[tuple[float, ...], tuple[Shadow, PartFacts] | Refused] = {}

    def bound(self, setting_rad: Array) -> Shadow | Refused:
        """See `Workshop`."""
        return PartsWorkshop(self._scanner).bound(setting_rad)

    def shadow(self, setting_rad: Array) -> Shadow | Refused:
        """See `Workshop`; refused as well where clearance, loads, walls or beams fail."""
        made = self._of(setting_rad)
        return made if isinstance(made, Refused) else made[0]

    def facts(self, setting_rad: Array) -> PartFacts:
        """See `Bench`."""
        made = self._of(setting_rad)
        assert not isinstance(made, Refused)
        return made[1]

    def _of(self, setting_rad: Array) -> tuple[Shadow, PartFacts] | Refused:
        key = tuple(round(math.degrees(angle), 2) for angle in setting_rad)
        if key not in self._made:
            self._made[key] = _made(at_setting(self._scanner, setting_rad))
        return self._made[key]


def _made(scanner: Scanner) -> tuple[Shadow, PartFacts] | Refused:
    from cad.assembly.make import make_parts
    from cad.checks.run import run_checks

    try:
        assembly = make_parts(scanner)
        checks, shadow = run_checks(scanner, assembly, lambda _: None)
    except BuildError as error:
        return Refused(str(error))
    failed = [check.message for check in checks if check.severity == "error"]
    return Refused(failed[0]) if failed else (shadow, _facts(scanner, assembly, checks))


def _facts(scanner: Scanner, assembly: Assembly, checks: Sequence[Check]) -> PartFacts:
    from cad.assembly.masses import link_bodies

    margins = {
        check.kind: check.limit / check.value
        for check in checks
        if check.kind in LOADS and check.limit is not None and check.value
    }
    weakest = min(margins, key=lambda kind: margins[kind], default="")
    return PartFacts(
        mass_g=1000 * sum(body.mass_kg for body in link_bodies(scanner, assembly).values()),
        load_margin=margins[weakest] if weakest else None,
        weakest=weakest,
        deflection_deg=next((check.value for check in checks if check.kind == BENDS), None),
        cost_usd=_cost(scanner, assembly),
    )


def _cost(scanner: Scanner, assembly: Assembly) -> float | None:
    """Of lidar, servo, ring, bearings and belt, no more; None where a price is not known."""
    bought = (scanner.lidar, scanner.servo, scanner.slip_ring, *assembly.layout.drive.products)
    prices = [product.price_usd for product in bought if product is not None]
    known = [price for price in prices if price is not None]
    return sum(known) if len(known) == len(prices) else None

"""Which lidar, servo and slip ring of the catalogue go together, and why the others do not.

    python -m benchmarks.cad.combinations [ALPHA_ROT BETA_ROT ALPHA_LASER BETA_LASER]

Every triple is laid out with all its parts and joints, but no solid: what cannot be made is refused there.
"""

from __future__ import annotations

import itertools
import re
import sys
from collections import Counter, defaultdict

from scanwright.cad.parts.all_parts import laid_out
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.catalogue.catalogue import Catalogue, load_catalogue
from scanwright.design.catalogue.products import Lidar, Servo, SlipRing
from scanwright.design.errors import BuildError
from scanwright.design.scanner import scanner_of

TILTED = (0.0, 31.0, 6.0, 15.0)


def main(angles: tuple[float, ...] = TILTED) -> None:
    """Lay out all of them, and print what goes with what."""
    catalogue = load_catalogue()
    kinds = [[one.name for one in catalogue if isinstance(one, kind)] for kind in (Lidar, Servo, SlipRing)]
    laid_out: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    refused: Counter[str] = Counter()
    for lidar, servo, ring in itertools.product(*kinds):
        reason = _refusal(catalogue, angles, lidar, servo, ring)
        if reason is None:
            laid_out[servo, ring].append(lidar)
        else:
            refused[f"{servo} with {ring}: {_general(reason, lidar)}"] += 1
    total = len(kinds[0]) * len(kinds[1]) * len(kinds[2])
    print(f"{sum(map(len, laid_out.values()))} of {total} laid out, at {angles}")
    for (servo, ring), lidars in laid_out.items():
        named = "every lidar" if len(lidars) == len(kinds[0]) else ", ".join(lidars)
        print(f"  {servo} with {ring}: {len(lidars)}: {named}")
    for reason, count in refused.most_common():
        print(f"  refused {count}: {reason}")


def _refusal(catalogue: Catalogue, angles: tuple[float, ...], lidar: str, servo: str, ring: str) -> str | None:
    names = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")
    chosen = AngleSet(
        task="combinations",
        angles_deg=Angles(**dict(zip(names, angles, strict=True))),
        sensor=lidar,
        servo=servo,
        slip_ring=ring,
    )
    try:
        laid_out(scanner_of(chosen, "fdm-0.4", catalogue))
    except BuildError as error:
        return str(error)
    return None


def _general(reason: str, lidar: str) -> str:
    """Without the lidar's name and the numbers that go with it, so that like reasons count together."""
    return re.sub(r"-?\d+\.\d+", "#", reason.replace(lidar, "the lidar"))


if __name__ == "__main__":
    main(tuple(map(float, sys.argv[1:5])) or TILTED)

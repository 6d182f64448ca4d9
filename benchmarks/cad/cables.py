"""How many leads and cables find their way, and are tied: `python -m benchmarks.cad.cables [SETTINGS]`.

The settings and combinations of products are those of `benchmarks.cad.parts`; everything is laid out without the CAD
kernel. Leads run on the rotor from the ring to each outlet of the lidar, cables from servo and stator to the deck.
"""

from __future__ import annotations

import sys
from collections import Counter

from benchmarks.cad.parts import COMBINATIONS, scanners_of
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.cables.leads import leads_of, tied_mm
from scanwright.cad.layout.cables.standing import standing_leads_of
from scanwright.cad.layout.cables.ties import foot_ties_of
from scanwright.cad.layout.layout import layout_of
from scanwright.design.errors import BuildError


def main(count: int = 300) -> None:
    """Lay them out and print what found its way."""
    asked: Counter[str] = Counter()
    found: Counter[str] = Counter()
    refused = 0
    for scanner in scanners_of(COMBINATIONS, count):
        try:
            layout = layout_of(scanner)
        except BuildError as error:
            refused += 1
            print(f"refused {scanner.angles.angles_deg}: {error}")
            continue
        seat, leads = layout.linkage.hub_tie, leads_of(layout)
        drive = "belts" if isinstance(layout.stack, BeltStack) else "servos on the axis"
        counted = {
            f"leads on rotors of {drive}": [lead.path is not None for lead in leads],
            f"of those laid, under a tongue of the hub, {drive}": [
                seat is not None and tied_mm(lead, seat) is not None for lead in leads if lead.path is not None
            ],
            "linkages with a tongue behind the plate": [bool(layout.linkage.plate_ties)],
            "cables from servos and stators": [lead.path is not None for lead in standing_leads_of(layout)],
            "mounts with slots in the foot": [] if layout.deck.flat else [bool(foot_ties_of(layout.deck))],
        }
        for what, done in counted.items():
            asked[what] += len(done)
            found[what] += sum(done)
    for what, number in sorted(asked.items()):
        print(f"{what}: {found[what]} of {number}")
    print(f"{refused} of {count} settings refused")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

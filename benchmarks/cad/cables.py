"""How many leads and cables find their way, and are tied: `python -m benchmarks.cad.cables [SETTINGS]`.

The settings and combinations of products are those of `benchmarks.cad.parts`; everything is laid out, no solid is
made. Leads run on the rotor from the ring to each outlet of the lidar, cables from servo and stator to the deck.
"""

from __future__ import annotations

import sys
from collections import Counter

from benchmarks.cad.parts import COMBINATIONS, scanners_of
from scanwright.cad.layout.cables.leads import tied_mm
from scanwright.cad.parts.all_parts import laid_out
from scanwright.design.errors import BuildError


def main(count: int = 300) -> None:
    """Lay them out and print what found its way."""
    wanted: Counter[str] = Counter()
    done: Counter[str] = Counter()
    refused = 0
    for scanner in scanners_of(COMBINATIONS, count):
        try:
            layout = laid_out(scanner)
        except BuildError as error:
            refused += 1
            print(f"refused {scanner.angles.angles_deg}: {error}")
            continue
        seat, leads = layout.linkage.hub_tie, layout.leads
        drive = "servos on the axis" if layout.drive.tied_to == "neck" else "belts"
        counted = {
            f"leads on rotors of {drive}": [lead.path is not None for lead in leads],
            f"of those laid, under a tongue of the hub, {drive}": [
                seat is not None and tied_mm(lead, seat) is not None for lead in leads if lead.path is not None
            ],
            "linkages with a tongue behind the plate": [bool(layout.linkage.plate_ties)],
            "cables from servos and stators": [lead.path is not None for lead in layout.cables],
            "mounts with slots in the foot": [] if layout.deck.flat else [bool(layout.deck.ties)],
        }
        for what, each in counted.items():
            wanted[what] += len(each)
            done[what] += sum(each)
    for what, number in sorted(wanted.items()):
        print(f"{what}: {done[what]} of {number}")
    print(f"{refused} of {count} settings refused")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

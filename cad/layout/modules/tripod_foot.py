"""Numbers of the plate between the mount's foot and a tripod. No kernel.

The nut of the tripod's screw is in a pocket that is open towards the mount, on a thin floor that tripod and nut clamp:
no thread is in plastic. Millimetres, in the axes of the deck (`Deck.rotation`), z from the lower face of the mount's
foot.
"""

from dataclasses import dataclass

from scanwright.cad.layout.joints import shank_mm
from scanwright.cad.screws import TRIPOD_SCREW, Screw, Thread, thread_in_part
from scanwright.design.catalogue.products import Printer

LEAST = 8.0  # thickness: the nut and a floor under it
FLOOR = 2.0  # under the tripod's nut: its screw protrudes little
OVER_NUTS = 2.8  # of the mount's screws
PROTRUDES = 4.5  # of the screws of tripods, the short ones: ISO 1222, from memory; longer ones fit
HEEL = 19.0  # half the width of the narrowest plate of a tripod's head: assumed


@dataclass(frozen=True, slots=True)
class TripodFoot:
    """One plate; `mount` and `tripod` are the threads of their screws."""

    thickness: float
    mount: Thread
    tripod: Thread


def tripod_foot_of(screw: Screw, printer: Printer, above: float) -> TripodFoot:
    """Return the plate below a thickness of the mount, so thick that no screw of the mount protrudes."""
    longest = shank_mm(screw, above, "trap", OVER_NUTS)
    mount = thread_in_part(screw, printer, carries=True)
    thickness = max(LEAST, longest - above) if mount.trap is not None else LEAST
    return TripodFoot(thickness, mount, thread_in_part(TRIPOD_SCREW, printer, carries=True))

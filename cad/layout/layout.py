"""Every number of one scanner that more than one of its parts needs, worked out once. No kernel: plain numpy."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from typing import Any

from scanwright.cad.layout.balance.counterweight import Counterweight, counterweight_of
from scanwright.cad.layout.belt.drive import belt_drive
from scanwright.cad.layout.cables.ties import hub_tie_of, plate_ties_of
from scanwright.cad.layout.deck import Deck, deck_of
from scanwright.cad.layout.direct.drive import direct_drive
from scanwright.cad.layout.drive import DriveLayout, Stack
from scanwright.cad.layout.envelope import screw_travel_mm
from scanwright.cad.layout.linkage import AlignmentLinkage, linkage_of
from scanwright.design.left_out import LeftOut
from scanwright.design.motion import Sweep
from scanwright.design.scanner import NO_MODULES, Scanner


@dataclass(frozen=True, slots=True)
class Layout:
    """One scanner before it has parts; `counterweight` is the bar, or why there is none."""

    scanner: Scanner
    drive: DriveLayout
    deck: Deck
    linkage: AlignmentLinkage
    counterweight: Counterweight | LeftOut

    @property
    def stack(self) -> Stack:
        """Every number along the axis."""
        return self.drive.stack


def layout_of(scanner: Scanner) -> Layout:
    """Lay out one scanner.

    Raises:
        BuildError: it cannot be laid out.
    """
    drive = drive_of(scanner)
    deck, linkage = deck_of(scanner, drive), linkage_of(scanner, drive.stack)
    ties = plate_ties_of(scanner.lidar, linkage)
    linkage = replace(linkage, plate_ties=() if isinstance(ties, LeftOut) else ties)
    bar = counterweight_of(scanner, deck, linkage)
    if isinstance(bar, Counterweight):
        linkage = replace(linkage, ear=bar.ear)
    tie = hub_tie_of(scanner, linkage)
    linkage = replace(linkage, hub_tie=None if isinstance(tie, LeftOut) else tie)
    return Layout(scanner, drive, deck, linkage, bar)


def drive_of(scanner: Scanner) -> DriveLayout:
    """The drive of one scanner: a belt where the ring is a capsule, else the servo on the axis.

    Raises:
        BuildError: it cannot be laid out.
    """
    ring = scanner.slip_ring
    return belt_drive(scanner) if ring is not None and ring.bore_mm == 0 else direct_drive(scanner)


def mount_offset_mm(scanner: Scanner) -> tuple[float, float, float]:
    """`t_world_rot_mm`: the optical centre in the world; its origin is the centre of the deck holes, or on a tripod.

    Raises:
        BuildError: the scanner cannot be laid out.
    """
    return deck_of(scanner, drive_of(scanner)).t_world_rot


def config_hash(scanner: Scanner) -> str:
    """Twelve hex digits of everything that shapes the parts: angles, products, and the name on their labels; not J."""
    angles, drive = scanner.angles, drive_of(scanner)
    # the journal's bearing has had its place in the list since before there were others
    others: list[dict[str, Any] | None] = [
        product.model_dump() for product in drive.products if product != drive.stack.bearing
    ]
    content: dict[str, Any] = {
        "task": angles.task,
        "angles": angles.angles_deg.model_dump(),
        "delta": angles.delta_rotvec_rot_deg,
        "deck": None if scanner.deck is None else scanner.deck.model_dump(),
        "products": [
            None if product is None else product.model_dump()
            for product in (scanner.lidar, scanner.servo, scanner.slip_ring, drive.stack.bearing, scanner.printer)
        ]
        + others,
    }
    if (travel := screw_travel_mm(scanner.lidar)) > 0:
        content["screw_travel_mm"] = travel  # slots, where nobody has verified the lidar's holes
    if isinstance(angles.motion, Sweep):
        content["sweep"] = angles.motion.limits_deg  # one that keeps the gears on a flank needs no counterweight
    if scanner.modules != NO_MODULES:
        content["modules"] = scanner.modules.model_dump()
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode("utf-8")).hexdigest()[:12]

"""Places of everything of one scanner; each step is a function of earlier records. No kernel."""

from dataclasses import dataclass, replace

from scanwright.cad.layout.belt.drive import belt_drive
from scanwright.cad.layout.deck import Deck, deck_of
from scanwright.cad.layout.direct.drive import direct_drive
from scanwright.cad.layout.drive import DriveLayout
from scanwright.cad.layout.envelope import envelope_of
from scanwright.cad.layout.hub import Hub
from scanwright.cad.layout.rotor.counterweight import Counterweight, counterweight_of
from scanwright.cad.layout.rotor.linkage import AlignmentLinkage, linkage_body_of, neck_corners
from scanwright.cad.layout.rotor.ties import hub_tie_of, plate_ties_of
from scanwright.design.arrays import Array
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Where everything is: the input for the descriptions of parts."""

    scanner: Scanner  # angles and products
    drive: DriveLayout  # all below the hub
    deck: Deck  # that the scanner is screwed to
    linkage: AlignmentLinkage  # between hub and lidar
    neck: Array  # corners of its neck, shape (n, 3)
    counterweight: Counterweight | LeftOut  # the bar with its estimated length, or why there is none
    ties_left_out: tuple[LeftOut, ...]  # seats of cable ties that have no place

    @property
    def stack(self) -> Hub:
        """Every number along the axis."""
        return self.drive.stack


def placement_of(scanner: Scanner) -> Placement:
    """Place everything of one scanner."""
    drive = drive_of(scanner)
    deck = deck_of(scanner, drive)
    body = linkage_body_of(scanner, drive.envelope, drive.stack)
    neck = neck_corners(body, 0)
    plate = plate_ties_of(scanner.lidar, body, neck)
    plate_ties = () if isinstance(plate, LeftOut) else plate
    bar = counterweight_of(scanner, drive, deck, body, plate_ties, neck)
    ear = None if isinstance(bar, LeftOut) else bar.ear
    hub = hub_tie_of(scanner, drive, body, ear, neck)
    return Placement(
        scanner=scanner,
        drive=drive,
        deck=deck,
        linkage=replace(body, ear=ear, hub_tie=None if isinstance(hub, LeftOut) else hub, plate_ties=plate_ties),
        neck=neck,
        counterweight=bar,
        ties_left_out=tuple(tie for tie in (hub, plate) if isinstance(tie, LeftOut)),
    )


def drive_of(scanner: Scanner) -> DriveLayout:
    """Return the drive of one scanner: a belt if the ring is a capsule, else the servo on the axis."""
    ring, envelope = scanner.slip_ring, envelope_of(scanner.lidar)
    capsule = ring is not None and ring.bore_mm == 0
    return belt_drive(scanner, envelope) if capsule else direct_drive(scanner, envelope)

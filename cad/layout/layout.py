"""The layout of one scanner: every number that more than one of its parts needs, computed once. No kernel.

`layout_of` places everything, collects the descriptions of the parts, and routes the cables around them.
"""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

from scanwright.cad.layout.cables.fixed import FixedCable, fixed_cables_of
from scanwright.cad.layout.cables.leads import RotorLead, leads_of
from scanwright.cad.layout.cables.obstacles import Shape
from scanwright.cad.layout.direct.frame import ServoFrame
from scanwright.cad.layout.drive import DriveLayout
from scanwright.cad.layout.envelope import screw_travel_mm
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.placement import Placement, placement_of
from scanwright.design.left_out import LeftOut
from scanwright.design.motion import Sweep
from scanwright.design.scanner import NO_MODULES, Scanner


class PlacedPart(Protocol):
    """What the layout reads of a part."""

    @property
    def turns(self) -> bool:
        """Whether it turns about the rotation axis."""

    @property
    def joints(self) -> tuple[Joint, ...]:
        """What it is screwed to."""

    @property
    def avoid(self) -> tuple[Shape, ...]:
        """Space that cables must stay clear of."""


Parts = Callable[[Placement], Sequence[PlacedPart | LeftOut]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout(Placement):
    """One scanner before its parts are made."""

    joints: tuple[Joint, ...]  # all joints, in the order of the parts; those with slots last
    leads: tuple[RotorLead, ...]  # on the rotor, between ring and lidar
    cables: tuple[FixedCable, ...]  # that do not turn
    left_out: tuple[LeftOut, ...]  # parts that this scanner does not need
    # twelve hex digits of everything that shapes the parts: angles, products, the name on the labels; not J
    digest: str


def layout_of(scanner: Scanner, parts_of: Parts) -> Layout:
    """Lay out one scanner; `parts_of` returns its parts, and those that it does not need."""
    place = placement_of(scanner)
    described = parts_of(place)
    parts = [part for part in described if not isinstance(part, LeftOut)]
    joints = [*(joint for part in parts for joint in part.joints), *place.deck.joints]
    avoid = {turns: [shape for part in parts if part.turns == turns for shape in part.avoid] for turns in (True, False)}
    return Layout(
        **{field.name: getattr(place, field.name) for field in fields(Placement)},
        joints=tuple(sorted(joints, key=lambda joint: joint.slot_mm is not None)),
        leads=leads_of(place, avoid[True]),
        cables=fixed_cables_of(place, avoid[False]),
        left_out=(
            *place.drive.left_out,
            *place.ties_left_out,
            *(part for part in described if isinstance(part, LeftOut)),
        ),
        digest=digest_of(scanner, place.drive),
    )


def digest_of(scanner: Scanner, drive: DriveLayout) -> str:
    """Return twelve hex digits of everything that shapes the parts; see `Layout.digest`."""
    angles = scanner.angles
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
        content["screw_travel_mm"] = travel  # slots, if the lidar's holes are not verified
    if (frame := drive.of(ServoFrame)) is not None:
        content["frame_window"] = frame.window_y  # from the exit of the servo's cable, which shapes no other part
    if isinstance(angles.motion, Sweep):
        content["sweep"] = angles.motion.limits_deg  # one that keeps the gears on a flank needs no counterweight
    if scanner.modules != NO_MODULES:
        content["modules"] = scanner.modules.model_dump()
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode("utf-8")).hexdigest()[:12]

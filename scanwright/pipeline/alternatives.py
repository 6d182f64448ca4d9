"""Other servos and slip rings for a scanner that cannot be built: strong enough, and with a possible layout."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from scanwright.cad.layout.placement import placement_of
from scanwright.design.angles import AngleSet
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import BuildError
from scanwright.design.task.task import LoadedTask
from scanwright.pipeline.new_task import torque_nm

MOST = 3


def what_fits(loaded: LoadedTask, angles: AngleSet) -> str:
    """Return the end of a message: servos and rings with which the lidar can be laid out at these angles."""
    layouts = list(islice(_layouts(loaded, angles), MOST))
    if not layouts:
        return f"; no servo and slip ring of the catalogue fit {angles.sensor} at these angles"
    return f"; {angles.sensor} can be laid out at these angles with {', or '.join(layouts)}"


def _layouts(loaded: LoadedTask, angles: AngleSet) -> Iterator[str]:
    """Yield names of servo and ring: other rings first, then other servos with the same ring, then the rest."""
    servos = [each for each in loaded.products if isinstance(each, Servo)]
    rings: list[SlipRing | None] = [None]
    if angles.slip_ring is not None:
        rings = [each for each in loaded.products if isinstance(each, SlipRing)]
    pairs = [
        (servo, ring)
        for servo in servos
        for ring in rings
        if torque_nm(loaded.lidar, ring) <= servo.continuous_torque_nm
    ]

    def differs(pair: tuple[Servo, SlipRing | None]) -> tuple[bool, bool, str]:
        servo, ring = pair
        return servo.name != angles.servo, ring is not None and ring.name != angles.slip_ring, servo.name

    for servo, ring in sorted(pairs, key=differs):
        name = None if ring is None else ring.name
        try:
            placement_of(loaded.scanner(angles.model_copy(update={"servo": servo.name, "slip_ring": name})))
        except BuildError:
            continue
        yield servo.name if name is None else f"{servo.name} and {name}"

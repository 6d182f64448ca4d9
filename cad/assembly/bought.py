"""Bought products: which bodies draw them, what moves these, and their colours.

Millimetres, rotation frame at gamma = 0. Every body is placed by an explicit location; the lidar by the angle set's
own `T_rot_laser`, the one that the point cloud goes through.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import cadquery as cq

from scanwright.cad import solids
from scanwright.cad.assembly import bought_shapes as draw
from scanwright.cad.assembly.tube import LEAD_CHORDS, lead_solid, standing_solid
from scanwright.cad.geometry.mesh import CHORD_ANGLE, CHORD_ERROR
from scanwright.cad.layout import names
from scanwright.cad.layout.belt.stack import BeltStack
from scanwright.cad.layout.cables.leads import RotorLead
from scanwright.cad.layout.cables.standing import StandingLead
from scanwright.cad.layout.direct.stack import DirectStack
from scanwright.cad.layout.layout import Layout
from scanwright.cad.parts.part_spec import STEEL, Colour
from scanwright.design.catalogue.products import Bearing

CASE, RING, LIDAR, RUBBER = (0.16, 0.16, 0.19), (0.72, 0.58, 0.20), (0.20, 0.23, 0.27), (0.10, 0.10, 0.11)
WINDOW = (0.35, 0.05, 0.08)
LEAD = (0.62, 0.12, 0.10)
LOWER = "_lower"


Frame = Literal["servo", "rot", "laser"]


@dataclass(frozen=True, slots=True, kw_only=True)
class BodySpec:
    """One body of a bought product.

    Attributes:
        name: unique in the scanner.
        product: that it is a piece of, of `cad/layout/names.py`.
        frame: that it moves with.
        colour: sRGB.
        make: its solid, rotation frame.
        meets: body that it may touch though the other one moves: the other half of a ring, or what it drives.
        clear: whether beams pass it.
        from_below: whether it is put in from below, where its product comes twice.
        chords: what the mesh may be off by [mm], and the angle between two of its facets [rad].
    """

    name: str
    product: str
    frame: Frame
    colour: Colour
    make: Callable[[], cq.Solid]
    meets: str = ""
    clear: bool = False
    from_below: bool = False
    chords: tuple[float, float] = (CHORD_ERROR, CHORD_ANGLE)

    @property
    def turns(self) -> bool:
        """Whether it turns about the rotation axis."""
        return self.frame != "servo"


def bought_of(layout: Layout, leads: Sequence[RotorLead] = (), standing: Sequence[StandingLead] = ()) -> list[BodySpec]:
    """The bodies of everything that one scanner is bought with, of the leads on the rotor, and of the other cables."""
    stack = layout.stack
    drive = _of_belt(stack) if isinstance(stack, BeltStack) else _of_direct(layout, stack)
    return [*drive, *_of_lidar(layout), *_of_leads(leads), *_of_standing(standing)]


def _of_direct(layout: Layout, stack: DirectStack) -> Iterator[BodySpec]:
    """Servo, ring and bearing."""
    servo = layout.scanner.servo
    case, horn = partial(draw.servo_case, servo, stack.horn), partial(draw.servo_horn, servo, stack.horn)
    yield _servo(names.SERVO_CASE, "servo", case, meets=names.SERVO_HORN)
    yield _servo(names.SERVO_HORN, "rot", horn)
    if layout.scanner.slip_ring is not None:
        yield _ring(names.RING_STATOR, "servo", partial(draw.ring_stator, stack), meets=names.RING_ROTOR)
        yield _ring(names.RING_ROTOR, "rot", partial(draw.ring_rotor, stack))
    if stack.bearing is not None:
        yield from _bearing(stack.bearing, stack.bearing_top, "")


def _of_belt(stack: BeltStack) -> Iterator[BodySpec]:
    """Servo, bearings, capsule and belt."""
    case, horn = partial(draw.servo_case, stack.servo, stack.horn), partial(draw.servo_horn, stack.servo, stack.horn)
    yield _servo(names.SERVO_CASE, "servo", partial(_beside, stack, case))
    yield _servo(names.SERVO_OUTPUT, "servo", partial(_beside, stack, horn))
    yield from _bearing(stack.carrier, stack.tower_top, "_upper")
    yield from _bearing(stack.carrier, stack.lower_bottom + stack.carrier.width_mm, LOWER)
    yield _ring(names.RING_STATOR, "servo", partial(draw.capsule, stack), meets=names.RING_ROTOR)
    yield _ring(names.RING_ROTOR, "rot", partial(draw.capsule_rotor, stack))
    yield BodySpec(
        name=names.BELT,
        product=names.BELT,
        frame="servo",
        colour=RUBBER,
        make=partial(draw.belt, stack),
        meets=names.SHAFT_PULLEY,
    )


def _servo(name: str, frame: Frame, make: Callable[[], cq.Solid], meets: str = "") -> BodySpec:
    return BodySpec(name=name, product=names.SERVO, frame=frame, colour=CASE, make=make, meets=meets)


def _ring(name: str, frame: Frame, make: Callable[[], cq.Solid], meets: str = "") -> BodySpec:
    return BodySpec(name=name, product=names.RING, frame=frame, colour=RING, make=make, meets=meets)


def _bearing(bearing: Bearing, top: float, place: str) -> Iterator[BodySpec]:
    inner, outer = f"{names.BEARING}_inner{place}", f"{names.BEARING}_outer{place}"
    make = partial(draw.bearing_inner, bearing, top)
    low = place == LOWER
    yield BodySpec(name=inner, product=names.BEARING, frame="rot", colour=STEEL, make=make, from_below=low)
    make = partial(draw.bearing_outer, bearing, top)
    yield BodySpec(
        name=outer, product=names.BEARING, frame="servo", colour=STEEL, make=make, meets=inner, from_below=low
    )


def _of_lidar(layout: Layout) -> Iterator[BodySpec]:
    """Body, window, cap and cables."""
    lidar = layout.scanner.lidar
    makes = {
        names.LIDAR_BODY: partial(draw.lidar_body, lidar),
        names.LIDAR_WINDOW: partial(draw.lidar_window, lidar),
    }
    if lidar.window_z_mm[1] < lidar.body_mm[2]:  # else the window reaches to the top
        makes[names.LIDAR_CAP] = partial(draw.lidar_cap, lidar)
    for i, y in enumerate(lidar.cable_y_mm, start=1):
        makes[f"{names.LIDAR_CABLE}_{i}"] = partial(draw.lidar_cable, lidar, y)
    for name, make in makes.items():
        window = name == names.LIDAR_WINDOW
        yield BodySpec(
            name=name,
            product=names.LIDAR,
            frame="laser",
            colour=WINDOW if window else LIDAR,
            make=partial(_on_axis, layout, make),
            clear=window,
        )


def _of_leads(leads: Sequence[RotorLead]) -> Iterator[BodySpec]:
    """Those that have a way."""
    for i, lead in enumerate(leads, start=1):
        if lead.path is not None:
            yield BodySpec(
                name=f"{names.ROTOR_LEAD}_{i}",
                product=names.ROTOR_LEADS,
                frame="rot",
                colour=LEAD,
                make=partial(lead_solid, lead),
                chords=LEAD_CHORDS,
            )


def _of_standing(leads: Sequence[StandingLead]) -> Iterator[BodySpec]:
    """Those that have a way."""
    for lead in leads:
        if lead.path is not None:
            yield BodySpec(
                name=lead.name,
                product=names.STANDING_LEADS,
                frame="servo",
                colour=LEAD,
                make=partial(standing_solid, lead),
                chords=LEAD_CHORDS,
            )


def _beside(stack: BeltStack, make: Callable[[], cq.Solid]) -> cq.Solid:
    """A body of the servo where it stands beside the axis."""
    return make().moved(solids.location(stack.turn(), stack.beside() * [1.0, 1.0, 0.0]))


def _on_axis(layout: Layout, make: Callable[[], cq.Solid]) -> cq.Solid:
    """A body of the lidar, its optical centre where the angle set has it."""
    T = layout.scanner.angles.T_rot_laser()
    base = cq.Location(cq.Vector(0, 0, -layout.scanner.lidar.optical_height_mm))
    return make().moved(solids.location(layout.stack.R(), T[:3, 3] * 1000) * base)

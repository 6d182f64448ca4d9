"""The servo on the axis: horn, shaft through the ring, hub. See `Drive` in `cad/drive.py`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cad.drives.direct_words import DIRECT_STEPS
from cad.findings import Finding
from cad.layout.direct_stack import Stack
from cad.layout.fits import OnSheet, printed_journal, printed_seat, turned_spigot
from cad.layout.loads import ALUMINIUM_PA
from cad.layout.mounted import Carried
from cad.screws import SCREWS, Screw
from design.catalogue.products import Bearing, Belt, Product
from design.left_out import LeftOut
from design.scanner import Scanner

if TYPE_CHECKING:
    import cadquery as cq

    from cad.checks.check import Check
    from cad.geometry.inertia import Inertial
    from cad.statics.shaft import ShaftBend

SHAFT_PRINTABLE = 20.0  # mm: below it a printed shaft bends by about 1 deg (measured study)
SHAFT = "servo_shaft"
STACKED = (
    "base_mount",
    "servo",
    "servo_shaft",
    "cage_base",
    "slip_ring_adapter",
    "ring",
    "bearing_cage",
    "bearing",
    "alignment_linkage",
)


@dataclass(frozen=True, slots=True)
class DirectDrive:
    """The `Drive` of a scanner whose ring lets the shaft through, or that has none."""

    scanner: Scanner
    stack: Stack

    def products(self) -> tuple[Bearing | Belt, ...]:
        """The bearing of a tilted axis."""
        return () if self.stack.bearing is None else (self.stack.bearing,)

    def order_number(self, product: Product) -> str:
        """Its name."""
        return product.name

    def turned(self) -> frozenset[str]:
        """The shaft, where it is too thin to be printed."""
        return frozenset({SHAFT}) if self.stack.shaft_diameter < SHAFT_PRINTABLE else frozenset()

    def on_sheets(self) -> dict[str, OnSheet]:
        """Fits of a turned shaft in the hub, and of the bearing."""
        stack, fit = self.stack, self.scanner.printer.fit_clearance_mm
        found = {}
        if SHAFT in self.turned():
            found[SHAFT] = OnSheet((turned_spigot(stack.shaft_diameter, fit),))
        if stack.bearing is not None:
            found["bearing_cage"] = OnSheet((printed_seat(stack.bearing, fit),))
            found["alignment_linkage"] = OnSheet((printed_journal(stack.bearing, fit),))
        return found

    def carried(self) -> Carried:
        """The servo's case."""
        servo, stack = self.scanner.servo, self.stack
        low, high = servo.case_min_mm, servo.case_max_mm
        xs, ys, zs = ((low[i], high[i]) for i in range(3))
        around, top = max(stack.ring_radius + 8.0, stack.hub_radius), stack.ring_top  # with the adapter's arms
        if stack.bearing is not None:
            around, top = stack.cage_outer + 4.0, stack.cage_top  # with the heads of its screws
        return Carried(
            rear=stack.horn + low[2],
            ears=stack.horn + servo.case_rear_holes_z_mm,
            screw=SCREWS[servo.case_screw],
            holes=_corner_holes(servo.case_rear_holes_mm),
            corners=np.array([(x, y, stack.horn + z) for x in xs for y in ys for z in zs]),
            discs=((around, stack.horn), (around, top)),
            stands_alone=True,
        )

    def made(self) -> dict[str, Callable[[], cq.Solid]]:
        """Shaft, what keeps the ring from turning, and the cage of the bearing."""
        from cad.parts.bearing_cage import bearing_cage, cage_base, cage_of
        from cad.parts.servo_shaft import servo_shaft, shaft_of
        from cad.parts.slip_ring_adapter import adapter_of, slip_ring_adapter

        scanner, stack = self.scanner, self.stack
        made: dict[str, Callable[[], cq.Solid]] = {SHAFT: lambda: servo_shaft(shaft_of(scanner, stack))}
        cage = cage_of(scanner, stack)
        if scanner.slip_ring is not None:
            made["slip_ring_adapter"] = lambda: slip_ring_adapter(adapter_of(scanner, stack))
        elif cage is not None:
            made["cage_base"] = partial(cage_base, cage)
        if cage is not None:
            made["bearing_cage"] = partial(bearing_cage, cage)
        return made

    def bought(self) -> dict[str, cq.Solid]:
        """Servo, ring and bearing."""
        from cad.assembly import bought

        scanner, stack = self.scanner, self.stack
        bodies = {
            "servo_case": bought.servo_case(scanner.servo, stack.horn),
            "servo_horn": bought.servo_horn(scanner.servo, stack.horn),
        }
        if scanner.slip_ring is not None:
            bodies |= bought.ring_solids(stack)
        if stack.bearing is not None:
            bodies |= bought.bearing_solids(stack.bearing, stack.bearing_top)
        return bodies

    def sweeps(self) -> dict[str, cq.Solid]:
        """None: all that turns does so about the axis."""
        return {}

    def weights(self) -> tuple[list[Inertial], list[Inertial]]:
        """Servo, and half of ring and bearing each."""
        from cad.geometry import inertia

        stack, servo, ring = self.stack, self.scanner.servo, self.scanner.slip_ring
        case = ((*servo.case_min_mm[:2], servo.case_min_mm[2] + stack.horn), (*servo.case_max_mm[:2], stack.horn))
        halves = []
        if ring is not None:
            r = stack.ring_radius
            halves.append(inertia.of_box(ring.mass_g / 2, (-r, -r, stack.ring_bottom), (r, r, stack.ring_top)))
        if stack.bearing is not None:
            r, top = stack.bearing.outer_mm / 2, stack.bearing_top
            low, high = (-r, -r, top - stack.bearing.width_mm), (r, r, top)
            halves.append(inertia.of_box(stack.bearing.mass_g / 2, low, high))
        return [inertia.of_box(servo.mass_g, *case), *halves], halves

    def shapes(self) -> list[tuple[tuple[float, float, float], tuple[float, ...]]]:
        """Servo and ring."""
        servo, stack = self.scanner.servo, self.stack
        low, high = np.array(servo.case_min_mm), np.array(servo.case_max_mm)
        x, y, z = ((low + high) / 2 + [0.0, 0.0, stack.horn]).tolist()
        shapes: list[tuple[tuple[float, float, float], tuple[float, ...]]] = [((x, y, z), tuple(high - low))]
        if self.scanner.slip_ring is not None:
            middle = (0.0, 0.0, (stack.ring_top + stack.ring_bottom) / 2)
            shapes.append((middle, (stack.ring_radius, stack.ring_length)))
        return shapes

    def bend(self) -> ShaftBend:
        """A beam from horn to hub, held by the cage."""
        from cad.parts.bearing_cage import cage_of, stiffness_n_per_m
        from cad.statics.shaft import shaft_bend

        cage = cage_of(self.scanner, self.stack)
        modulus = ALUMINIUM_PA if self.turned() else 1e9 * self.scanner.printer.modulus_gpa
        return shaft_bend(self.stack, modulus, 0.0 if cage is None else stiffness_n_per_m(cage))

    def load_checks(self, bodies: dict[str, Inertial]) -> list[Check]:
        """Horn and bearing share the weight."""
        from cad.checks.mechanics import direct_loads

        return direct_loads(self.scanner, self.stack, bodies)

    def findings(self, bodies: dict[str, Inertial]) -> list[Finding]:
        """A shaft to have turned, and a horn that carries too much."""
        from cad.checks.remarks import tilt_moment, turn_from_metal

        shaft = self.stack.shaft_diameter
        why = f"{shaft:g} mm is too thin to print (0.9 deg of bending with the axis horizontal)"
        turned = [turn_from_metal(SHAFT, why)] if self.turned() else []
        return [*turned, *tilt_moment(self.scanner, self.stack, bodies)]

    def left_out(self) -> list[LeftOut]:
        """Adapter and cage."""
        out = []
        if self.scanner.slip_ring is None:
            out.append(LeftOut("slip_ring_adapter", "this scanner has no slip ring", 1, "parts"))
        if self.stack.bearing is None:
            servo = self.scanner.servo
            why = f"the horn of {servo.name} carries an axis this upright alone"
            if servo.radial_load_n is None:
                why = f"{why}, by what such a horn is trusted with: its maker rates none"
            out.append(LeftOut("bearing_cage", why, 1, "parts"))
        return out

    def steps(self) -> dict[str, tuple[str, str]]:
        """From the servo upwards."""
        if self.stack.bearing is None:
            return DIRECT_STEPS
        title, _ = DIRECT_STEPS["slip_ring_adapter"]  # the one that carries a cage is no fork
        return DIRECT_STEPS | {"slip_ring_adapter": (title, "Lower the plate over the shaft. {servo_case}")}

    def stacked(self) -> tuple[str, ...]:
        """In the order of the steps."""
        return STACKED

    def slotted(self) -> list[tuple[str, str, Screw, int, float, float]]:
        """None."""
        return []

    def shaping(self) -> dict[str, str]:
        """As `remarks.SHAPING` has it."""
        return {}

    def wiring(self) -> list[tuple[str, str]]:
        """What holds the ring's stator."""
        if self.scanner.slip_ring is None:
            return []
        return [("cable tie around the ring's stator", "groove of the adapter")]


def _corner_holes(holes: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """The four holes of the widest column pair that lie furthest apart along y."""
    widest = max(x for x, _ in holes)
    ys = sorted(y for x, y in holes if x == widest)
    return ((widest, ys[-1]), (-widest, ys[-1]), (-widest, ys[0]), (widest, ys[0]))

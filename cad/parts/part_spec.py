"""The description of a made part: its shape, joints, space, steps, rows of lists, and the values that shape it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import cadquery as cq

from scanwright.cad.layout.cables.obstacles import Shape
from scanwright.cad.layout.direct.loads import ALUMINIUM
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.loads import ALUMINIUM_G_CM3, STEEL_G_CM3
from scanwright.design.catalogue.product_base import Product
from scanwright.design.catalogue.products import Bearing, Printer
from scanwright.design.catalogue.servo import Servo

Process = Literal["printed", "turned", "sawn"]
Colour = tuple[float, float, float]
STEEL: Colour = (0.60, 0.62, 0.66)
COLOURS: Mapping[Process, Colour] = {"printed": (0.93, 0.45, 0.10), "turned": (0.75, 0.76, 0.78), "sawn": STEEL}
HORN = (
    "servo.horn_boss_diameter_mm",
    "servo.horn_boss_height_mm",
    "servo.horn_circle_mm",
    "servo.horn_holes",
    "servo.horn_first_hole_deg",
    "servo.horn_screw",
)
ON_CASE = ("servo.case_max_mm", "servo.holes", "servo.horn_diameter_mm", "servo.horn_thickness_mm")
SEATED = "the hub is on the end of the shaft without a gap, and does not rock when the lidar is pushed sideways"
BENCH = "Servo on the bench"  # section of `wiring.md`
TURNED_FROM = "aluminium EN AW-6082-T6"


@dataclass(frozen=True, slots=True)
class ToleratedDiameter:
    """Diameter of the cylinders of one diameter about the axis of a part's ordinates."""

    diameter: float  # as drawn
    hole: bool  # whether the material is outside
    tolerance: str  # text behind the diameter
    why: str  # its purpose


def printed_seat(bearing: Bearing, fit: float) -> ToleratedDiameter:
    """Return the diameter of a bearing's seat in a printed part, drawn half of the sliding fit wider."""
    why = f"seat of {bearing.name}, from size for size to a sliding fit"
    return ToleratedDiameter(bearing.outer_mm + fit / 2, True, f"±{_g(fit / 2)}", why)


def no_wider(diameter: float, fit: float, why: str) -> ToleratedDiameter:
    """Return a printed hole, drawn half of the sliding fit wider, and the reason for its upper limit."""
    return ToleratedDiameter(diameter + fit / 2, True, f"0/-{_g(fit / 2)}", why)


def spigot_in_hub(diameter: float, fit: float) -> ToleratedDiameter:
    """Return the diameter of a shaft's upper end in the printed hub."""
    return ToleratedDiameter(diameter, False, f"0/-{_g(fit / 2)}", "half of the fit in the printed hub")


def _g(value: float) -> str:
    return f"{round(value, 3):g}"


def to_centre(servo: Servo) -> str:
    """Return the sentence of a step that turns the servo to the centre of its encoder."""
    counts = 2 ** round(math.log2(servo.position_feedback_deg / servo.position_step_deg))
    centre = f"position {counts // 2} of {counts}"
    return (
        f"Power the servo alone (`wiring.md`, {BENCH}) and turn it to its centre ({centre}) with "
        "`scanwright servo-setup PORT --centre`. Then switch it off."
    )


@dataclass(frozen=True, slots=True)
class Step:
    """One assembly step."""

    title: str
    words: str  # with marks of `cad/layout/joints.py` for screws
    check: str = ""  # condition to check before the next step
    brings: tuple[str, ...] = ()  # bought products without a step of their own that come with it


@dataclass(frozen=True, slots=True)
class Row:
    """One row of the parts list."""

    kind: Literal["consumable", "wiring", "tool"]
    estimate: str  # name of its price in `cad/files/prices.py`
    part: str  # name and size
    source: str
    note: str = ""  # for the buyer


CRIMPS = Row("tool", "crimping pliers", "crimping pliers", "assembly.md", "for the leads")


@dataclass(frozen=True, slots=True, kw_only=True)
class PartSpec:
    """One part of one scanner, described before it is made: `make` alone needs the kernel."""

    name: str  # of `cad/layout/names.py`
    turns: bool  # whether it turns about the rotation axis
    make: Callable[[], cq.Solid]  # its solid, rotation frame at gamma = 0, mm; raises BuildError
    step: Step | None = None  # that adds it; None if another part has its step
    after: str = ""  # part or product whose step it follows, unless the drive lists it in `built`
    process: Process = "printed"  # of making it
    material: str = ""  # if it is not printed
    work: str = ""  # further work
    why_metal: str = ""  # why it is not printed
    fits: tuple[ToleratedDiameter, ...] = ()  # of its cylinders, for its drawing
    notes: tuple[str, ...] = ()  # lines of text of its drawing
    # of the ordinates of its drawing, in the plane z = 0 of the rotation frame
    axis: tuple[float, float] = (0.0, 0.0)
    shaped_by: tuple[str, ...] = ()  # fields of products, as "kind.field", that shape it
    # fields that shape something else, with its description; they precede `shaped_by` of any part
    shapes: Mapping[str, str] = field(default_factory=dict)
    angles: Literal["none", "rot", "laser"] = "none"  # those that shape it and are on its label
    # height in the laser frame of its face towards the lidar; None if it does not carry the lidar
    seat: float | None = None
    lifted: Literal["axis", "radius", "lidar", "deck"] = "axis"  # direction of its motion in the exploded view
    sweep: Callable[[], cq.Solid] | None = None  # its swept solid if it turns about another axis
    joints: tuple[Joint, ...] = ()  # its screws
    avoid: tuple[Shape, ...] = ()  # convex shapes that cables must stay clear of
    rows: tuple[Row, ...] = ()  # small parts and tools, for the parts list
    # of products inserted with it, and of parts on it: these precede their own
    steps: Mapping[str, Step] = field(default_factory=dict)

    @property
    def colour(self) -> Colour:
        """SRGB."""
        return COLOURS[self.process]

    @property
    def frame(self) -> Literal["servo", "rot"]:
        """Frame that it moves with."""
        return "rot" if self.turns else "servo"

    @property
    def metal(self) -> bool:
        """Whether it is of metal, not printed."""
        return self.process != "printed"

    def values_of(self, product: Product) -> tuple[str, ...]:
        """Return the fields of a product that shape this part, or one that it states in `shapes`."""
        kind = f"{product.kind}."
        return tuple(field.removeprefix(kind) for field in (*self.shaped_by, *self.shapes) if field.startswith(kind))

    def density_g_cm3(self, printer: Printer) -> float:
        """Return the density of its material."""
        turned = ALUMINIUM.density_g_cm3 if self.material == ALUMINIUM.name else ALUMINIUM_G_CM3
        densities = {"printed": printer.density_g_cm3, "turned": turned, "sawn": STEEL_G_CM3}
        return densities[self.process]

"""What the catalogue holds: records of lidars, servos, slip rings, bearings, belts, printers, 3D lidars.

Lengths are millimetres, masses grams.
"""

from __future__ import annotations

import itertools
import json
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.typing import ArrayLike
from pydantic import Field, PrivateAttr, model_validator
from pydantic_core import to_jsonable_python

from scanwright.design.catalogue.holes import Hole, HolePattern, mounting_holes
from scanwright.design.catalogue.known_error import KnownError
from scanwright.design.files.record import Record

Pair = tuple[float, float]
Triple = tuple[float, float, float]
Box = tuple[Triple, Triple]
UsbId = Annotated[str, Field(pattern="^[0-9a-f]{4}:[0-9a-f]{4}$")]


def _absent(value: object) -> bool:
    """Return whether a field that shapes parts is left out of the record, so that others keep their digest."""
    return value is None


class Provenance(Record):
    """Where a value comes from. `verified` means: two independent sources, or a drawing of the maker."""

    source: str
    verified: bool


class Product(Record):
    """Base of the catalogue records: name, maker, the provenance of each value, and the values known to be wrong."""

    kind: str
    name: str
    maker: str
    known_wrong: tuple[KnownError, ...] = Field(default=(), exclude=True, description="shapes no part")
    _provenance: dict[str, Provenance] = PrivateAttr(default_factory=dict)

    def provenance(self) -> dict[str, Provenance]:
        """Source of each value, by field name."""
        return self._provenance

    def unverified(self) -> list[str]:
        """Names of the values that are not verified."""
        return [field for field, origin in self._provenance.items() if not origin.verified]

    def caution(self, field: str) -> str:
        """Return what a message adds behind an unverified value; empty if it is verified."""
        origin = self._provenance.get(field)
        return "" if origin is None or origin.verified else " (not verified: measure yours)"

    def misfit(self) -> list[str]:
        """A warning that printed parts will not fit this product, a line for each reason below it; empty if they do."""
        reasons = [f"  {error.words(self)}" for error in self.known_wrong if not error.fits]
        return [f"{self.name}: parts printed for it will not fit the real device:", *reasons] if reasons else []

    def facts(self) -> dict[str, Any]:
        """Every value, and under `provenance` where it comes from, for a program to read."""
        sources = {field: origin.model_dump() for field, origin in self._provenance.items()}
        values = {field: to_jsonable_python(getattr(self, field)) for field in type(self).model_fields}
        return {**values, "provenance": sources}

    def lines(self) -> list[str]:
        """Every value with its source, in words."""
        values = []
        for field, origin in self._provenance.items():
            value = json.dumps(to_jsonable_python(getattr(self, field)))
            values.append(f"  {' ' if origin.verified else '?'} {field} = {value}   [{origin.source}]")
        wrong = [f"  ! {error.words(self)}   [{error.source}]" for error in self.known_wrong]
        mark = "  ? not verified: measure yours, and override the product in a catalogue file of your own"
        known = ["  ! does not agree with the real device"] if wrong else []
        return [f"{self.name} ({self.maker})", *values, *wrong, mark, *known]


Rating = Literal["usb2", "ethernet100", "none"]
Link = Literal["usb", "usb-powered", "ethernet", "serial"]


class Lead(Record):
    """One wire of a power lead. A net that has several colours differs from one revision of the cable to the next."""

    net: Literal["+", "-"]
    colour: str


class TiedPin(Record):
    """A pin that must be joined to another pin of the same plug if nothing drives it."""

    pin: str
    to: str


class Circuits(Record):
    """Equal circuits of a slip ring; a circuit for signals has less noise, not less current."""

    count: int = Field(gt=0)
    amps: float = Field(gt=0)
    use: Literal["power", "signal", "any"]


class Lidar(Product):
    """A 2D lidar. Body frame: origin on the base at the optical axis, x to the front, z up; mm."""

    kind: Literal["lidar"]
    steps_per_turn: int = Field(gt=0)
    first_step: int = Field(ge=0)
    last_step: int = Field(ge=0)
    front_step: int = Field(ge=0)
    scan_rate_hz: float = Field(gt=0)
    range_min_mm: float = Field(gt=0)
    range_max_mm: float = Field(gt=0)
    range_practical_mm: float | None = Field(default=None, gt=0, description="what users really get")
    range_sigma_mm: float = Field(gt=0, description="noise of one range, one standard deviation")
    sigma_by_range_mm: tuple[Pair, ...] | None = Field(
        default=None, min_length=1, exclude_if=_absent, description="points (range, noise), linear between them"
    )
    triangulates: bool | None = Field(
        default=None, exclude_if=_absent, description="noise beyond the last point grows with the square of the range"
    )
    mass_g: float = Field(gt=0)
    price_usd: float | None = Field(default=None, gt=0)
    wavelength_nm: float | None = Field(default=None, gt=0)
    body_mm: Triple
    optical_height_mm: float = Field(gt=0)
    window_z_mm: Pair
    window_radius_mm: float = Field(gt=0)
    ears_mm: tuple[Box, ...] | None = Field(
        default=None, exclude_if=_absent, description="boxes of the body outside of body_mm"
    )
    holes: tuple[Hole, ...] = Field(min_length=1)
    cable_y_mm: tuple[float, ...]
    cable_z_mm: float
    cable_diameter_mm: float = Field(gt=0)
    cable_straight_mm: float = Field(ge=0)
    usb_ids: tuple[UsbId, ...] | None = Field(
        default=None, exclude=True, description="vendor:product of its port; shapes no part"
    )
    family: str | None = Field(default=None, exclude=True, description="who drives it; shapes no part")
    supply_v: Pair | None = Field(default=None, exclude=True, description="least and most; shapes no part")
    current_a: float | None = Field(default=None, gt=0, exclude=True, description="as it runs; shapes no part")
    peak_a: float | None = Field(default=None, gt=0, exclude=True, description="as it starts; shapes no part")
    inrush_a: float | None = Field(
        default=None, gt=0, exclude=True, description="for a moment when power comes on; shapes no part"
    )
    link: Link | None = Field(default=None, exclude=True, description="how its data leave; shapes no part")
    signal_v: float | None = Field(
        default=None, gt=0, exclude=True, description="level of its serial line; shapes no part"
    )
    sends_only: bool | None = Field(
        default=None, exclude=True, description="its serial line has no RX pin; shapes no part"
    )
    connector: str | None = Field(default=None, exclude=True, description="shapes no part")
    tied_pins: tuple[TiedPin, ...] | None = Field(
        default=None, exclude=True, description="pins to join if nothing drives them; shapes no part"
    )
    leads: tuple[Lead, ...] | None = Field(
        default=None, exclude=True, description="colours of its power lead; shapes no part"
    )

    @model_validator(mode="after")
    def _steps_are_ordered(self) -> Lidar:
        if not self.first_step < self.last_step < self.first_step + self.steps_per_turn:
            raise ValueError(f"steps {self.first_step}..{self.last_step} do not fit {self.steps_per_turn} per turn")
        if self.range_min_mm >= self.range_max_mm:
            raise ValueError(f"range_min_mm {self.range_min_mm} is not below range_max_mm {self.range_max_mm}")
        if any(b[0] < a[0] for a, b in itertools.pairwise(self.sigma_by_range_mm or ())):
            raise ValueError("sigma_by_range_mm: its ranges do not rise")
        return self

    def lead_colours(self) -> dict[str, tuple[str, ...]]:
        """Colours that a verified source names for the + and - lead; empty if no source does."""
        origin = self._provenance.get("leads")
        if not self.leads or origin is None or not origin.verified:
            return {}
        return {net: tuple(lead.colour for lead in self.leads if lead.net == net) for net in ("+", "-")}

    @property
    def base(self) -> HolePattern:
        """Holes in its base that a plate below it can be screwed to."""
        return mounting_holes((hole for hole in self.holes if hole.at_mm[2] == 0), "-z")

    @property
    def half_mm(self) -> Pair:
        """Half of the rectangle about the optical axis that holds the body with its ears, along x and y."""
        corners = np.abs(
            [[0.5 * self.body_mm[0], 0.5 * self.body_mm[1], 0.0], *(c for ear in self.ears_mm or () for c in ear)]
        )
        return float(corners[:, 0].max()), float(corners[:, 1].max())

    @property
    def stated_range_m(self) -> float:
        """The farthest that it sees, as its maker states it."""
        return self.range_max_mm / 1000

    @property
    def practical_range_m(self) -> float:
        """The farthest that its users get where that is known, else as stated: what a scanner can count on."""
        return (self.range_practical_mm or self.range_max_mm) / 1000

    def sigma_mm(self, range_mm: ArrayLike) -> Float[ndarray, " *n"]:
        """Noise of a range at ranges: one standard deviation, same shape.

        A triangulating sensor measures the place of a spot, which moves with the inverse of the range: its noise grows
        with the square of it. Beyond range_max_mm the noise is that at range_max_mm.
        """
        range_mm = np.minimum(range_mm, self.range_max_mm)
        points = np.array(self.sigma_by_range_mm or [(self.range_max_mm, self.range_sigma_mm)])
        sigma = np.interp(range_mm, points[:, 0], points[:, 1])
        beyond = np.maximum(1.0, range_mm / points[-1, 0]) if self.triangulates else 1.0
        return np.asarray(sigma * beyond**2)

    def bearings_rad(self) -> Float[ndarray, " beams"]:
        """Angle of every beam about the scan-plane normal, 0 to the front, shape (beams,) (SCIP 2.0, p. 5)."""
        steps = np.arange(self.first_step, self.last_step + 1)
        return (steps - self.front_step) * (2 * np.pi / self.steps_per_turn)


class Servo(Product):
    """A servo. Frame: origin on the horn axis at the horn face, z out of the horn, +y to the horn's end; mm."""

    kind: Literal["servo"]
    position_step_deg: float = Field(gt=0)
    angular_range_deg: float = Field(gt=0, le=360)
    position_feedback_deg: float = Field(gt=0, le=360)
    mass_g: float = Field(gt=0)
    price_usd: float | None = Field(default=None, gt=0)
    supply_v: Pair | None = Field(default=None, exclude=True, description="least and most; shapes no part")
    rated_v: float = Field(default=12.0, gt=0, exclude=True, description="of torque and speed; shapes no part")
    idle_a: float | None = Field(default=None, gt=0, exclude=True, description="that it rests with; shapes no part")
    stall_a: float | None = Field(default=None, gt=0, exclude=True, description="at rated_v; shapes no part")
    bus: Literal["rs485", "ttl"] | None = Field(default=None, exclude=True, description="shapes no part")
    connector: str | None = Field(default=None, exclude=True, description="shapes no part")
    stall_torque_nm: float = Field(gt=0)
    no_load_rpm: float = Field(gt=0)
    radial_load_n: float | None = Field(default=None, gt=0)
    axial_load_n: float | None = Field(default=None, gt=0)
    backlash_deg: float | None = Field(default=None, ge=0)
    case_min_mm: Triple
    case_max_mm: Triple
    horn_diameter_mm: float = Field(gt=0)
    horn_thickness_mm: float = Field(gt=0)
    horn_boss_diameter_mm: float = Field(ge=0)
    horn_boss_height_mm: float = Field(ge=0)
    horn_circle_mm: float = Field(gt=0)
    horn_holes: int = Field(gt=1)
    horn_first_hole_deg: float = Field(ge=0, lt=360, description="of one hole from +y, position at its centre")
    horn_screw: Literal["M2", "M2.5", "M3"]
    horn_thread_depth_mm: float = Field(gt=0)
    holes: tuple[Hole, ...] = Field(description="of the case; those of the horn are stated by the horn_ fields")
    usb_ids: tuple[UsbId, ...] | None = Field(
        default=None,
        exclude=True,
        description="vendor:product of the adapters between it and a computer; shapes no part",
    )

    cable_exit_mm: Triple | None = Field(
        default=None, exclude=True, description="where its cable leaves the case; shapes no part"
    )
    cable_out: Triple | None = Field(default=None, exclude=True, description="unit vector, likewise; shapes no part")
    cable_diameter_mm: float | None = Field(default=None, gt=0, exclude=True, description="shapes no part")
    cable_bend_radius_mm: float | None = Field(
        default=None, gt=0, exclude=True, description="least one of its middle; shapes no part"
    )
    adapter: str | None = Field(default=None, exclude=True, description="between its bus and a computer")
    adapter_usd: float | None = Field(default=None, gt=0, exclude=True, description="price of the adapter")
    cable: str | None = Field(default=None, exclude=True, description="between the adapter and the servo")

    @property
    def front(self) -> HolePattern:
        """Holes in the face that the horn comes out of."""
        return mounting_holes(self.holes, "+z")

    @property
    def rear(self) -> HolePattern:
        """Holes in the opposite face."""
        return mounting_holes(self.holes, "-z")

    @property
    def continuous_torque_nm(self) -> float:
        """Torque that it gives continuously: a fifth of its stall torque."""
        return self.stall_torque_nm / 5


class Flange(Record):
    """The flange of a capsule, by which its stator is held; mm."""

    diameter_mm: float = Field(gt=0)
    thickness_mm: float = Field(gt=0)
    below_top_mm: float = Field(ge=0, description="of its face towards the rotor below the body's end there")
    circle_mm: float = Field(gt=0)
    holes: int = Field(gt=1)
    hole_mm: float = Field(gt=0)
    screw: Literal["M2.5", "M3", "M4", "M5"]


class Rotor(Record):
    """The stub of a capsule's rotor, out of which its leads come; mm."""

    diameter_mm: float = Field(gt=0)
    length_mm: float = Field(gt=0)


class SlipRing(Product):
    """A slip ring; `bore_mm = 0` is a capsule, `length_mm` that of its body, and it needs `flange` and `rotor`."""

    kind: Literal["slip_ring"]
    bore_mm: float = Field(ge=0)
    outer_diameter_mm: float = Field(gt=0)
    length_mm: float = Field(gt=0)
    mass_g: float = Field(gt=0)
    max_rpm: float | None = Field(default=None, gt=0)
    circuits: str
    ways: tuple[Circuits, ...] | None = Field(
        default=None, exclude=True, description="circuits by current; shapes no part"
    )
    lead_diameter_mm: float | None = Field(
        default=None, gt=0, exclude=True, description="of the bundle that goes to one outlet; shapes no part"
    )
    lead_bend_radius_mm: float | None = Field(
        default=None, gt=0, exclude=True, description="least one of its middle; shapes no part"
    )
    stator_exit: Literal["side", "end"] | None = Field(
        default=None, exclude=True, description="where the stator's leads leave, at its lower end; shapes no part"
    )
    price_usd: float | None = Field(default=None, gt=0)
    friction_nm: Pair | None = Field(
        default=None, exclude_if=_absent, description="drag of its brushes and seals, least and most"
    )
    data: Rating | None = Field(default=None, exclude=True, description="fastest data it is rated for; shapes no part")
    flange: Flange | None = Field(default=None, exclude_if=_absent)
    rotor: Rotor | None = Field(default=None, exclude_if=_absent)

    @model_validator(mode="after")
    def _capsules_have_a_flange(self) -> SlipRing:
        if self.bore_mm > 0:
            return self
        if self.flange is None or self.rotor is None:
            raise ValueError("bore_mm = 0 is a capsule: tell its flange and rotor, or take a through bore (12.7 mm)")
        if self.flange.circle_mm + self.flange.hole_mm > self.flange.diameter_mm:
            raise ValueError(f"flange.circle_mm {self.flange.circle_mm:g} leaves no edge around its holes")
        if self.flange.circle_mm - self.flange.hole_mm < self.outer_diameter_mm:
            raise ValueError(f"flange.circle_mm {self.flange.circle_mm:g} puts its holes into outer_diameter_mm")
        if self.flange.below_top_mm + self.flange.thickness_mm > self.length_mm:
            raise ValueError(f"flange.below_top_mm {self.flange.below_top_mm:g} lies beyond length_mm")
        if self.rotor.diameter_mm >= self.outer_diameter_mm:
            raise ValueError(f"rotor.diameter_mm {self.rotor.diameter_mm:g} is not below outer_diameter_mm")
        return self


class Bearing(Product):
    """A ball bearing, sealed on both sides."""

    kind: Literal["bearing"]
    bore_mm: float = Field(gt=0)
    outer_mm: float = Field(gt=0)
    width_mm: float = Field(gt=0)
    mass_g: float = Field(gt=0)
    static_load_n: float = Field(gt=0)
    price_usd: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _rings_have_walls(self) -> Bearing:
        if self.outer_mm < self.bore_mm + 8.0:
            raise ValueError(f"outer_mm {self.outer_mm:g} leaves no ring around bore_mm {self.bore_mm:g}")
        return self


class Belt(Product):
    """A closed toothed belt of one profile and width, in the lengths that shops keep."""

    kind: Literal["belt"]
    pitch_mm: float = Field(gt=0)
    width_mm: float = Field(gt=0)
    thickness_mm: float = Field(gt=0, description="with its teeth")
    tooth_height_mm: float = Field(gt=0)
    pitch_line_mm: float = Field(gt=0, description="from the tips of a pulley's teeth out to the belt's cords")
    groove_radius_mm: float = Field(gt=0, description="of the pulley's groove")
    teeth: tuple[int, ...] = Field(min_length=1, description="of the lengths in stock")
    working_tension_n: float = Field(gt=0, description="that the teeth carry all their life")
    stiffness_n: float = Field(gt=0, description="tension for a strain of 1")
    mass_g: float = Field(gt=0)
    price_usd: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _teeth_are_inside(self) -> Belt:
        if self.tooth_height_mm >= self.thickness_mm or 2 * self.groove_radius_mm >= self.pitch_mm:
            raise ValueError(f"tooth_height_mm {self.tooth_height_mm:g} or groove_radius_mm leaves no belt or no tooth")
        return self


class Multibeam(Product):
    """A ready-made 3D lidar: layers at fixed elevations that turn about z, upright; azimuth 0 ahead, 90 to the left."""

    kind: Literal["multibeam"]
    elevations_deg: tuple[float, ...] = Field(min_length=2)
    azimuth_deg: Pair
    turn_rate_hz: float = Field(gt=0)
    azimuth_step_deg: float = Field(gt=0, description="between two measurements of one layer at turn_rate_hz")
    points_per_second: float = Field(gt=0)
    price_usd: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _angles_rise(self) -> Multibeam:
        if not (np.diff([-90.0, *self.elevations_deg, 90.0]) > 0).all():
            raise ValueError("elevations_deg do not rise within -90 .. 90")
        if not self.azimuth_step_deg <= self.azimuth_deg[1] - self.azimuth_deg[0] <= 360:
            raise ValueError(f"azimuth_deg {list(self.azimuth_deg)} does not rise by azimuth_step_deg to 360")
        return self


class Printer(Product):
    """How a part is printed in plastic, and what that costs in millimetres."""

    kind: Literal["printer"]
    screw_clearance_mm: float = Field(ge=0, le=1)
    fit_clearance_mm: float = Field(ge=0, le=1)
    min_wall_mm: float = Field(gt=0)
    layer_mm: float | None = Field(default=None, gt=0, description="height of layers, where it lays filament")
    line_mm: float | None = Field(default=None, gt=0, description="width of lines, where it lays filament")
    bed_mm: Triple
    density_g_cm3: float = Field(gt=0)
    modulus_gpa: float = Field(gt=0, description="of elasticity, printed solid")
    thread: Literal["cut", "insert", "nut"] = Field(
        default="cut", description="what screws that end in a part hold on to"
    )

    @model_validator(mode="after")
    def _prints_plastic(self) -> Printer:
        if self.modulus_gpa >= 20.0:  # no metal is as soft, no unfilled plastic as stiff
            raise ValueError(
                f"modulus_gpa {self.modulus_gpa:g} is that of a metal: a printer prints plastic (below 20); have parts "
                "milled or turned from their STEP files"
            )
        return self

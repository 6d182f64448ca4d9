"""Records of slip rings. Millimetres, grams."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, model_validator

from scanwright.design.catalogue.product_base import Circuits, Pair, Product, Rating, absent, no_shape
from scanwright.design.files.record import Record


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
    """The rotor beyond the body, where its leads leave: the stub of a capsule, the clamping collar of a bore; mm."""

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
    ways: tuple[Circuits, ...] | None = no_shape("circuits by current")
    lead_diameter_mm: float | None = Field(
        default=None, gt=0, exclude_if=absent, description="of all leads of one side as one bundle"
    )
    lead_bend_radius_mm: float | None = Field(
        default=None, gt=0, exclude_if=absent, description="least one of its middle"
    )
    plug_mm: Pair | None = Field(
        default=None, exclude_if=absent, description="width and thickness of the largest plug moulded to its leads"
    )
    stator_exit: Literal["end"] = Field(
        default="end", exclude=True, description="where the stator's leads leave: the end opposite its rotor"
    )
    price_usd: float | None = Field(default=None, gt=0)
    friction_nm: Pair | None = Field(
        default=None, exclude_if=absent, description="drag of its brushes and seals, least and most"
    )
    data: Rating | None = no_shape("fastest data it is rated for")
    flange: Flange | None = Field(default=None, exclude_if=absent)
    rotor: Rotor | None = Field(default=None, exclude_if=absent)

    def leads_mm(self, outlets: int) -> float:
        """Return the diameter of the leads to each of some outlets that share the bundle; 0 if it is unknown."""
        return round((self.lead_diameter_mm or 0.0) / math.sqrt(max(1, outlets)), 2)

    @model_validator(mode="after")
    def _capsules_have_a_flange(self) -> SlipRing:
        if self.bore_mm > 0:
            return self
        if self.flange is None or self.rotor is None:
            raise ValueError("bore_mm = 0 is a capsule: state its flange and rotor, or use a through bore (12.7 mm)")
        if self.flange.circle_mm + self.flange.hole_mm > self.flange.diameter_mm:
            raise ValueError(f"flange.circle_mm {self.flange.circle_mm:g} leaves no edge around its holes")
        if self.flange.circle_mm - self.flange.hole_mm < self.outer_diameter_mm:
            raise ValueError(f"flange.circle_mm {self.flange.circle_mm:g} puts its holes into outer_diameter_mm")
        if self.flange.below_top_mm + self.flange.thickness_mm > self.length_mm:
            raise ValueError(f"flange.below_top_mm {self.flange.below_top_mm:g} lies beyond length_mm")
        if self.rotor.diameter_mm >= self.outer_diameter_mm:
            raise ValueError(f"rotor.diameter_mm {self.rotor.diameter_mm:g} is not below outer_diameter_mm")
        return self

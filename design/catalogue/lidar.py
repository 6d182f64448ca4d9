"""Records of 2D lidars. Millimetres, grams."""

from __future__ import annotations

import itertools
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from scanwright.design.catalogue.holes import Hole, HolePattern, mounting_holes
from scanwright.design.catalogue.lidar_cable import Cable
from scanwright.design.catalogue.product_base import (
    Box,
    Lead,
    Link,
    Pair,
    Product,
    TiedPin,
    Triple,
    UsbId,
    absent,
)


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
        default=None, min_length=1, exclude_if=absent, description="points (range, noise), linear between them"
    )
    triangulates: bool | None = Field(
        default=None, exclude_if=absent, description="noise beyond the last point grows with the square of the range"
    )
    mass_g: float = Field(gt=0)
    price_usd: float | None = Field(default=None, gt=0)
    wavelength_nm: float | None = Field(default=None, gt=0)
    body_mm: Triple
    optical_height_mm: float = Field(gt=0)
    window_z_mm: Pair
    window_radius_mm: float = Field(gt=0)
    ears_mm: tuple[Box, ...] | None = Field(
        default=None, exclude_if=absent, description="boxes of the body outside of body_mm"
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
    cables: tuple[Cable, ...] | None = Field(
        default=None, min_length=1, exclude_if=absent, description="between the lidar and what it is joined to"
    )
    mass_with_cables: bool | None = Field(
        default=None, exclude_if=absent, description="whether mass_g counts its cables"
    )
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
    def body_g(self) -> float:
        """Mass without its cables."""
        return self.mass_g - (sum(cable.mass_g for cable in self.cables or ()) if self.mass_with_cables else 0.0)

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

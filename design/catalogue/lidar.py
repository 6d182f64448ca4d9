"""Records of 2D lidars. Millimetres, grams."""

from __future__ import annotations

import itertools
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from scanwright.design.catalogue.holes import Face, Hole, HolePattern, mounting_holes, side_holes
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
    no_shape,
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
    usb_ids: tuple[UsbId, ...] | None = no_shape("vendor:product of its port")
    family: str | None = no_shape("who drives it")
    supply_v: Pair | None = no_shape("least and most")
    current_a: float | None = no_shape("as it runs", gt=0)
    peak_a: float | None = no_shape("as it starts", gt=0)
    inrush_a: float | None = no_shape("for a moment when power comes on", gt=0)
    link: Link | None = no_shape("how its data leave")
    signal_v: float | None = no_shape("level of its serial line", gt=0)
    sends_only: bool | None = no_shape("its serial line has no RX pin")
    connector: str | None = no_shape()
    cables: tuple[Cable, ...] | None = Field(
        default=None, min_length=1, exclude_if=absent, description="between the lidar and what it is joined to"
    )
    mass_with_cables: bool | None = Field(
        default=None, exclude_if=absent, description="whether mass_g counts its cables"
    )
    tied_pins: tuple[TiedPin, ...] | None = no_shape("pins to join if nothing drives them")
    leads: tuple[Lead, ...] | None = no_shape("colours of its power lead")

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
        """Return the colours of the + and - lead by a verified source; empty if there is none."""
        origin = self._provenance.get("leads")
        if not self.leads or origin is None or not origin.verified:
            return {}
        return {net: tuple(lead.colour for lead in self.leads if lead.net == net) for net in ("+", "-")}

    @property
    def base(self) -> HolePattern:
        """Holes in its base that a plate below it can be screwed to."""
        return mounting_holes((hole for hole in self.holes if hole.at_mm[2] == 0), "-z")

    @property
    def sides(self) -> dict[Face, HolePattern]:
        """Holes of the sides that walls are screwed to, by side; empty if it is held by its base, or by nothing."""
        return {} if len(self.base.places) >= 2 else side_holes(self.holes, self.half_mm)

    @property
    def held(self) -> dict[Face, HolePattern]:
        """Holes that hold it, by face: of its sides, or of its base."""
        return self.sides or {"-z": self.base}

    @property
    def half_mm(self) -> Pair:
        """Half sides, along x and y, of the rectangle about the optical axis that contains the body and its ears."""
        corners = np.abs(
            [[0.5 * self.body_mm[0], 0.5 * self.body_mm[1], 0.0], *(c for ear in self.ears_mm or () for c in ear)]
        )
        return float(corners[:, 0].max()), float(corners[:, 1].max())

    @property
    def stated_range_m(self) -> float:
        """Largest range as stated by its maker [m]."""
        return self.range_max_mm / 1000

    @property
    def practical_range_m(self) -> float:
        """Largest range that its users get if known, else as stated [m]."""
        return (self.range_practical_mm or self.range_max_mm) / 1000

    def sigma_mm(self, range_mm: ArrayLike) -> Float[ndarray, " *n"]:
        """Return the standard deviation of a measured range [mm] at ranges; constant beyond range_max_mm.

        The noise of a triangulating sensor grows with the square of the range.
        """
        range_mm = np.minimum(range_mm, self.range_max_mm)
        points = np.array(self.sigma_by_range_mm or [(self.range_max_mm, self.range_sigma_mm)])
        sigma = np.interp(range_mm, points[:, 0], points[:, 1])
        beyond = np.maximum(1.0, range_mm / points[-1, 0]) if self.triangulates else 1.0
        return np.asarray(sigma * beyond**2)

    def bearings_rad(self) -> Float[ndarray, " beams"]:
        """Return the angle of every beam about the scan-plane normal, 0 to the front (SCIP 2.0, p. 5)."""
        steps = np.arange(self.first_step, self.last_step + 1)
        return (steps - self.front_step) * (2 * np.pi / self.steps_per_turn)

"""Records of bearings, belts, 3D lidars and printers. Millimetres, grams."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from scanwright.design.catalogue.product_base import Pair, Product, Triple


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
        if not self.azimuth_step_deg <= round(self.azimuth_deg[1] - self.azimuth_deg[0], 9) <= 360:
            raise ValueError(f"azimuth_deg {list(self.azimuth_deg)} does not rise by azimuth_step_deg to 360")
        return self


class Printer(Product):
    """A printer of plastic parts, its accuracy and its limits."""

    kind: Literal["printer"]
    screw_clearance_mm: float = Field(ge=0, le=1)
    fit_clearance_mm: float = Field(ge=0, le=1)
    min_wall_mm: float = Field(gt=0)
    layer_mm: float | None = Field(default=None, gt=0, description="height of layers, if it lays filament")
    line_mm: float | None = Field(default=None, gt=0, description="width of lines, if it lays filament")
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

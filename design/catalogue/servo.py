"""Records of servos. Millimetres, grams."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from pydantic import Field

from scanwright.design.catalogue.holes import Hole, HolePattern, mounting_holes
from scanwright.design.catalogue.product_base import Pair, Product, Triple, UsbId, no_shape


class Servo(Product):
    """A servo. Frame: origin on the horn axis at the horn face, z out of the horn, +y to the horn's end; mm."""

    kind: Literal["servo"]
    position_step_deg: float = Field(gt=0)
    angular_range_deg: float = Field(gt=0, le=360)
    position_feedback_deg: float = Field(gt=0, le=360)
    mass_g: float = Field(gt=0)
    price_usd: float | None = Field(default=None, gt=0)
    supply_v: Pair | None = no_shape("least and most")
    rated_v: float = Field(default=12.0, gt=0, exclude=True, description="of torque and speed; shapes no part")
    idle_a: float | None = no_shape("that it rests with", gt=0)
    stall_a: float | None = no_shape("at rated_v", gt=0)
    bus: Literal["rs485", "ttl"] | None = no_shape()
    connector: str | None = no_shape()
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
    horn_kind: Literal["tapped", "self_tapping"] | None = Field(
        default=None,
        exclude=True,
        description="of its holes: threads in metal (also if unset), or plain ones in plastic",
    )
    holes: tuple[Hole, ...] = Field(description="of the case; those of the horn are stated by the horn_ fields")
    usb_ids: tuple[UsbId, ...] | None = no_shape("vendor:product of the adapters between it and a computer")
    cable_exit_mm: Triple | None = no_shape("where its cable leaves the case")
    cable_out: Triple | None = no_shape("unit vector, likewise")
    cable_diameter_mm: float | None = no_shape(gt=0)
    cable_bend_radius_mm: float | None = no_shape("least one of its middle", gt=0)
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
        """Continuous torque: a fifth of the stall torque."""
        return self.stall_torque_nm / 5


def most_backlash_deg(products: Iterable[Product]) -> float:
    """Return the largest known full backlash [deg] of the servos among some products; 0 if none is known."""
    servos = (product for product in products if isinstance(product, Servo))
    return max((servo.backlash_deg for servo in servos if servo.backlash_deg is not None), default=0.0)

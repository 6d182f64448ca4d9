"""What the sheet of a part says that its solid does not show: fits, the axis it is measured from, lines of text. mm."""

from __future__ import annotations

from dataclasses import dataclass

from scanwright.design.catalogue.products import Bearing


@dataclass(frozen=True, slots=True)
class ToleratedDiameter:
    """Diameter of the cylinders of one diameter about the axis that a part is measured from.

    Attributes:
        diameter: as the part is drawn.
        hole: whether the material is outside.
        tolerance: as it stands behind the diameter.
        why: what it is for.
    """

    diameter: float
    hole: bool
    tolerance: str
    why: str


@dataclass(frozen=True, slots=True)
class OnSheet:
    """What one part's sheet says beyond its shape.

    Attributes:
        fits: of its cylinders.
        notes: lines of text.
        axis: where the axis that its ordinates run from meets the rotation frame's plane z = 0.
    """

    fits: tuple[ToleratedDiameter, ...] = ()
    notes: tuple[str, ...] = ()
    axis: tuple[float, float] = (0.0, 0.0)


def printed_seat(bearing: Bearing, fit: float) -> ToleratedDiameter:
    """Diameter of a bearing's outer ring in a printed part, which is drawn half of the sliding fit wider."""
    why = f"seat of {bearing.name}, from size for size to a sliding fit"
    return ToleratedDiameter(bearing.outer_mm + fit / 2, True, f"±{_g(fit / 2)}", why)


def no_wider(diameter: float, fit: float, why: str) -> ToleratedDiameter:
    """A printed hole that is drawn with half of the sliding fit, and what goes wrong where it has more."""
    return ToleratedDiameter(diameter + fit / 2, True, f"0/-{_g(fit / 2)}", why)


def spigot_in_hub(diameter: float, fit: float) -> ToleratedDiameter:
    """Diameter of a shaft's upper end in the printed hub."""
    return ToleratedDiameter(diameter, False, f"0/-{_g(fit / 2)}", "half of the fit in the printed hub")


def _g(value: float) -> str:
    return f"{round(value, 3):g}"

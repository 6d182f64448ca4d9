"""Data of a part's sheet that its solid does not show: fits, the axis of its ordinates, lines of text. mm."""

from dataclasses import dataclass

from scanwright.design.catalogue.products import Bearing


@dataclass(frozen=True, slots=True)
class ToleratedDiameter:
    """Diameter of the cylinders of one diameter about the axis of a part's ordinates."""

    diameter: float  # as drawn
    hole: bool  # whether the material is outside
    tolerance: str  # text behind the diameter
    why: str  # its purpose


@dataclass(frozen=True, slots=True)
class OnSheet:
    """Data of one part's sheet beyond its shape."""

    fits: tuple[ToleratedDiameter, ...] = ()  # of its cylinders
    notes: tuple[str, ...] = ()  # lines of text
    axis: tuple[float, float] = (0.0, 0.0)  # of its ordinates, in the plane z = 0 of the rotation frame


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

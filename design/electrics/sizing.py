"""Fuses, wires, supplies and the drop of voltage: tables and short formulas."""

from __future__ import annotations

from collections.abc import Callable

# (mm2, A): cross-sections of IEC 60228, and a cautious current of one wire in a loose bundle (unverified)
WIRES_A = ((0.25, 2.0), (0.5, 5.0), (0.75, 7.5), (1.0, 10.0), (1.5, 15.0), (2.5, 20.0))
FUSES_A = (1.0, 2.0, 3.0, 4.0, 5.0, 7.5, 10.0, 15.0, 20.0)  # blades, ISO 8820-3
SUPPLIES_A = (2.1, 3.0, 5.0, 6.0, 8.5, 12.5, 17.0)  # enclosed 12 V supplies of 25 to 200 W
OVER_PEAK = 1.1  # rating of a fuse over the largest current of its branch, assumed
COPPER_OHM_MM2_PER_M = 0.0178  # at 20 deg C
RING_OHM = 0.05  # one circuit with its leads, assumed: makers of data rings quote contacts of 0.01, capsules vary
CONVERTER = 0.85  # efficiency of a converter, assumed


def fuse_for(peak_a: float) -> float:
    """Return the smallest blade fuse [A] that carries a peak.

    Raises:
        ValueError: none of the table does.
    """
    return _least(FUSES_A, OVER_PEAK * peak_a)


def wire_for(fuse_a: float, thick_enough: Callable[[float], bool] = lambda _: True) -> float:
    """Return the smallest cross-section [mm2] that a fuse protects and that is thick enough, else the largest."""
    protected = [mm2 for mm2, amps in WIRES_A if amps >= fuse_a]
    return next(filter(thick_enough, protected), protected[-1])


def wire_a(mm2: float) -> float:
    """Return the current [A] that a cross-section carries."""
    return dict(WIRES_A)[mm2]


def supply_for(peak_a: float) -> float:
    """Return the smallest supply [A] that carries all peaks at once."""
    return _least(SUPPLIES_A, peak_a)


def wire_drop_v(amps: float, mm2: float, metres: float) -> float:
    """Return the voltage drop along both wires."""
    return 2 * amps * COPPER_OHM_MM2_PER_M * metres / mm2


def _least(table: tuple[float, ...], required: float) -> float:
    if required > table[-1]:
        raise ValueError(f"{required:g} A is more than {table[-1]:g} A, the largest of the table")
    return next(value for value in table if value >= required)

"""Error bounds as printed: one digit, rounded up, the same everywhere."""

from __future__ import annotations

import numpy as np


def rounded_to_error(value: float, error: float) -> tuple[float, float]:
    """A value rounded to one digit of its error, and the error rounded up to hold the rounding too."""
    if not error > 0:
        return value, error
    digits = -int(np.floor(np.log10(error)))
    unit = 10.0**-digits
    rounded = round(value, digits)
    total = error + abs(value - rounded)
    return rounded, round(float(np.ceil(total / unit - 1e-9)) * unit, digits)


def error_words(value: float, error: float) -> str:
    """The bound on the error of a value in one digit; it also holds if the value is rounded to that digit."""
    return f"{rounded_to_error(value, error)[1]:.0e}"

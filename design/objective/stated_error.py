"""Error bounds as printed: one digit, rounded up."""

from __future__ import annotations

import numpy as np


def rounded_to_error(value: float, error: float) -> tuple[float, float]:
    """Return a value rounded to the first digit of its error, and the error rounded up to include the rounding."""
    if not error > 0:
        return value, error
    digits = -int(np.floor(np.log10(error)))
    unit = 10.0**-digits
    rounded = round(value, digits)
    total = error + abs(value - rounded)
    return rounded, round(float(np.ceil(total / unit - 1e-9)) * unit, digits)


def error_words(value: float, error: float) -> str:
    """Return the bound of an error with one digit, which includes rounding the value to that digit."""
    return f"{rounded_to_error(value, error)[1]:.0e}"

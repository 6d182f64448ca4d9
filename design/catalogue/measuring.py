"""How a person measures the values of a device that no source verifies."""

from __future__ import annotations

from scanwright.design.catalogue.product_base import Product

PATTERN = "press paper on the face so that the holes mark it, and measure between the marks with a caliper"
WITH_CALIPER = "measure yours with a caliper"
HOW = {
    "holes": f"{PATTERN}; try a screw of the stated size by hand, and its depth with a wire",
    "horn_holes": "count the threaded holes of the horn",
    "horn_circle_mm": PATTERN,
    "horn_first_hole_deg": "set the servo to its centre, and look where the first hole is from its +Y face",
    "horn_screw": "try a screw of the stated size by hand",
    "horn_thread_depth_mm": "measure the depth with a wire",
    "fit_clearance_mm": "print the fit coupon",
    "screw_clearance_mm": "print the fit coupon",
    "friction_nm": "hang a weight on a lever at the free ring, and note where it turns",
    "mass_g": "weigh yours",
}


def how_to_measure(field: str) -> str:
    """Return how a person measures a value, in words."""
    return HOW.get(field, WITH_CALIPER)


def measure_first(product: Product, *fields: str) -> str:
    """Return a sentence on how to measure the unverified ones of some values; empty if there is none."""
    open_ = [field for field in product.unverified() if field in fields]
    if not open_:
        return ""
    steps = "; ".join(dict.fromkeys(how_to_measure(field) for field in open_))
    return f"Measure first, no source verifies {', '.join(open_)} of {product.name}: {steps}."

"""Error against run time of numerical choices, and stiff and extreme cases with a known result."""

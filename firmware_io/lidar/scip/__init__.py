"""Hokuyo's SCIP 2: protocol, driver, and the clock behind its ticks."""

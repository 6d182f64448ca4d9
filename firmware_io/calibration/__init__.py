"""Calibration from static scenes: mounting errors, range bias, encoder errors, time offset."""

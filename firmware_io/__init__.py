"""Devices, recordings, assembly, calibration, registration and cloud files."""

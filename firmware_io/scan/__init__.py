"""Acquisition of a scan: plan, devices, recorder, diagnosis."""

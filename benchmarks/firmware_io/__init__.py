"""Benchmarks of devices, recordings and clouds."""

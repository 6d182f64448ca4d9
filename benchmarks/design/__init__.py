"""Benchmarks of the optimiser and of J."""

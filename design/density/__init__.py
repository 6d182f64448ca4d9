"""Beam density: beam directions, and exact counts of the beams within a ball for full turns and sweeps."""

"""Trinamic TMCL: a stepper with its driver and encoder; datagrams of nine bytes, parameters instead of registers."""

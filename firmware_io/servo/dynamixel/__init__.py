"""Dynamixel, protocols 1.0 and 2.0: registers, bus, driver."""

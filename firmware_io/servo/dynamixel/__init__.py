"""Packets and control tables of Dynamixel, protocols 1.0 and 2.0."""

"""Trajectory of the platform from files and topics, with a gyro between poses."""

"""Poses of the platform over time, from files and topics, with a gyro between them."""

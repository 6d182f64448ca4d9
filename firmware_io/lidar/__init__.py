"""Lidar drivers, one folder per protocol family."""

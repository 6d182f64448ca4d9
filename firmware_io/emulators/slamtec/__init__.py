"""Emulated RPLIDARs: models, packets, and the sensor."""

"""The assumptions of a calibration: neither the platform nor the scene moves."""

"""What a calibration takes for granted: a platform, and a scene, that stand still."""

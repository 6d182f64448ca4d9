"""Detection of motion of the platform or the scene."""

"""Measured properties of solids: meshes, holes, inertia, pose on the bed."""

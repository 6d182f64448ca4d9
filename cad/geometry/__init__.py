"""Solids measured: meshes, holes, inertia, how a part lies on the bed."""

"""Meshes around the scanner: the ray caster, and the surfaces that are seen from a point."""

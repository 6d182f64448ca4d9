"""Deformation of parts under load: finite elements for the printed parts, beam elements for the shaft."""

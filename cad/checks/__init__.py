"""Checks of a scanner before its parts are made; one file per subject."""

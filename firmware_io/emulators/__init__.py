"""Emulated devices on pseudo-terminals."""

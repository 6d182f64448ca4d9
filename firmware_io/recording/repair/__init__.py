"""Repair of damaged recordings."""

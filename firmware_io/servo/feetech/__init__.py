"""Feetech STS and SMS: packets of our own, control tables."""

"""Servo bus: serial line, transactions, registers, and access to one servo."""

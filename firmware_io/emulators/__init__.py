"""Emulators: devices made of software, on pseudo-terminals, that behave as the hardware does."""

"""The wiring of a scanner as data: devices, wires and ring circuits, what they carry, and what is wrong with them."""

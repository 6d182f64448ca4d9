"""The wiring of a scanner as data: devices, wires, ring circuits, their currents, and the faults of it."""

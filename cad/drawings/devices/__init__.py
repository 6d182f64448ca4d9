"""Dimensioned sketches of bought devices, and 1:1 templates of their holes. Millimetres, frame of the device."""

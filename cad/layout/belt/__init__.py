"""The servo next to the axis, for capsule rings: hollow shaft in two bearings, and a belt."""

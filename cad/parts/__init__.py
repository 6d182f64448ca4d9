"""One file per printed or turned part: its shape and what is to know of it. Rotation frame, millimetres."""

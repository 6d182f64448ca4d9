"""One file per printed or turned part: its shape and description. Rotation frame, millimetres.

Functions that make a solid raise BuildError if a step does not give one valid solid.
"""

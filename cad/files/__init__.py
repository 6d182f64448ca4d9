"""What a build writes of its parts: STEP, STL, 3MF, GLB, URDF, parts list, steps."""

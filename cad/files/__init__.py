"""Files of a build: STEP, STL, 3MF, GLB, URDF, parts list, steps."""

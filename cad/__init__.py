"""How the scanner is made: parts, bought parts, assembly, export, URDF. Millimetres live here only."""

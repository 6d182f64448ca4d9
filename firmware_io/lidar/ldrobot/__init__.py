"""LD06, LD19 and STL27L: sensors that talk all the time, one way."""

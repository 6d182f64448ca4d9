"""A SICK lidar in software, which answers CoLa A and B."""

"""What the studio shows in 3D: the sphere, the scanner, a glimpse of a scan, and who makes them."""

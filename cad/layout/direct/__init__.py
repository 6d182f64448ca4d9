"""The servo on the axis: shaft through the ring, and the bearing that a tilted axis needs."""

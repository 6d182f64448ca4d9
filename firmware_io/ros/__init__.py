"""For robots: the frames of a calibrated scanner, and the node of ROS 2."""

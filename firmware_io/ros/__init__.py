"""ROS 2 node, and the frames of a calibrated scanner for robots."""

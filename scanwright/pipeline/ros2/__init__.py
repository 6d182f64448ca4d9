"""`out/<task>/ros2/`: the scanner as a package of ROS 2, ready for a workspace's `src`."""

"""Where the platform was over time: poses from files and topics, and what its gyro says between them."""

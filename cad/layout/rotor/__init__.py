"""What turns with the lidar: its linkage, the seats of cable ties, the counterweight. No kernel."""

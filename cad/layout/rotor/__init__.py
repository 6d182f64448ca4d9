"""Parts that turn with the lidar: linkage, seats of cable ties, counterweight. No kernel."""

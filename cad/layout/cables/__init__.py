"""Where the leads of the lidar run on the rotor: smooth paths, the room for them, a way through it. No kernel."""

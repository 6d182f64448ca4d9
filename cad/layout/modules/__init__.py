"""Every number of the parts that a scanner works without and a task may ask for. No kernel."""

"""Numbers of optional parts that a task may require. No kernel."""

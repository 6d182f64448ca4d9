"""Products that a task can name, each value with its source."""

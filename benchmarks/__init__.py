"""What the figures of the documentation come from; each is `python -m benchmarks.<name>`."""

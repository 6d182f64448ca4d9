"""More than one core: threads for compiled kernels, worker processes for work in the background."""

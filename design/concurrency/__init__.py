"""More than one core: threads for compiled kernels, a second process for work that nobody waits for."""

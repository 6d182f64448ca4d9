"""Error against run time of every method to compute J, and stiff and extreme cases."""

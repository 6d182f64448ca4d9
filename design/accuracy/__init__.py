"""Error against run time of every way to compute J, and stiff and extreme cases."""

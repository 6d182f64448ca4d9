"""What a study costs and what it survives; the command line is in `__main__.py`."""

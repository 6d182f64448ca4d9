"""What a static scene tells about the scanner that saw it: mounting errors, range bias, encoder errors, time offset."""

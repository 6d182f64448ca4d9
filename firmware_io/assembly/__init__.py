"""Assembly of recordings to clouds: de-skew, axis angle, turns."""

"""How the scanner is run: recordings, de-skew and assembly, cloud files."""

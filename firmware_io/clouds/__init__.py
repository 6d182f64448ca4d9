"""Reading and writing of cloud files."""

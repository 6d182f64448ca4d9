"""Wrong inputs over all commands and formats that read files."""

"""The records that commands print with `--json`, and their JSON schemas."""

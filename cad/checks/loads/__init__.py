"""What each drive bears, as checks."""

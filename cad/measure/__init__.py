"""What a maker's model of a device gives for its product file: holes, body, window, horn; all of it unverified."""

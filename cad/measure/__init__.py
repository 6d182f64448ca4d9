"""Values of a maker's model for a product file: holes, body, window, horn; all unverified."""

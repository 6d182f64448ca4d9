"""Checks of other people's recordings at import, and the corrections that they offer."""

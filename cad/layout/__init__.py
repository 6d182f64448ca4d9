"""Numbers that more than one part needs, for each drive; loads and balance. No kernel."""

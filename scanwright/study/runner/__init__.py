"""How the candidates of a study are worked off: units of work, their identity, results, processes."""

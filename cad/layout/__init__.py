"""Numbers that more than one part needs, for each drive; loads and balance. No kernel.

Functions raise BuildError if a scanner cannot be laid out.
"""

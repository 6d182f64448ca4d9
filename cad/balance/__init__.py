"""The counterweight of a tilted axis: how heavy it must be, and where there is room for it."""

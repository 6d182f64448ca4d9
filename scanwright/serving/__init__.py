"""What every live page stands on: the gate before it, how it is served and ends, and how it looks."""

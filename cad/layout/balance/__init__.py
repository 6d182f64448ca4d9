"""The counterweight of a tilted axis: how far the rotor is out of balance, and where a bar has room."""

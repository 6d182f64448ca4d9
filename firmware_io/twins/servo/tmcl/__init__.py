"""The twin of a stepper that speaks TMCL: its datagrams, its parameters, its steps, and the module that has them."""

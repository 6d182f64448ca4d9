"""The commands: one function each, whose docstring is the help; progress, errors and exit codes."""

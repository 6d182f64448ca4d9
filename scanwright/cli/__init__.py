"""The commands: one function each, its docstring is its help; progress, errors and exit codes."""

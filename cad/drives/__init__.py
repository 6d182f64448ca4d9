"""How the servo turns the shaft: on its axis, or beside it by a belt; what each layout is made of, bears and says."""

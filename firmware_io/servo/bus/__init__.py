"""The wire to servos: the serial line, transactions on it, registers, and one servo by its registers."""

"""Servo driver, its watchdog process, and one folder per protocol family."""

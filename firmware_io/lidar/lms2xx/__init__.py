"""SICK LMS 2xx, with their own telegrams over RS-422."""

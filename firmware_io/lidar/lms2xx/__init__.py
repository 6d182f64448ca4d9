"""SICK LMS 2xx, which speak telegrams of their own over RS-422."""

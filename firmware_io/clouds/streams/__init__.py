"""Conversion of clouds in parts, in bounded memory."""

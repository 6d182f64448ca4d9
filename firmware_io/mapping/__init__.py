"""Clouds as maps to drive by: where the floor is, what is free above it, and the files of it."""

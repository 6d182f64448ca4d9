"""Clouds as maps to drive by: the floor, the free space above it, and the files."""

"""Clouds of any size: read, surveyed and written part by part."""

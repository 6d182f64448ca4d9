"""Benchmarks of the pages and the studies, and the pictures of the documentation."""

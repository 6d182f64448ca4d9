"""Figures of one mount: coverage, gaps, poles, comparison, and their pictures."""

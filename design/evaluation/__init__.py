"""What one setting comes to: coverage, gaps, poles, comparison, and their pictures."""

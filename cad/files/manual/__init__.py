"""Putting a scanner together, step by step: what each step brings, its picture, and `assembly.md`."""

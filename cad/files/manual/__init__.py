"""Assembly instructions: steps, their pictures, and `assembly.md`."""

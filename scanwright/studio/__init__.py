"""The studio: drag the angles or paint the region of interest, and see the result."""

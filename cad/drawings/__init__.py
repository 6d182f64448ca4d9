"""One sheet per part: three views, an isometric, views onto inclined hole patterns, dimensions; PDF, DXF and SVG."""

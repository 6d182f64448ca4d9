"""Maps of places where somebody walks about."""

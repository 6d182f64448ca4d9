"""The studio's panel: sliders, facts, kept settings, saving and building."""

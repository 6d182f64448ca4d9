"""How far parts bend under their load: finite elements for the printed parts, beam elements for the shaft."""

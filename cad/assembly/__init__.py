"""All parts of one scanner together: solids of parts and bought bodies, masses, steps, what they hide."""

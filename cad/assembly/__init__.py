"""All parts of one scanner together: bodies, joints, masses, what they hide."""

"""The studio: a page in which a person drags the angles or paints what matters, and sees what it comes to."""

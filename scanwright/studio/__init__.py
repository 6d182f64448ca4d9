"""Live pages: the studio, in which a person drags the angles, and the view of a scan while it is taken."""

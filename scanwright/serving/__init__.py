"""Live pages: access checks, server and style."""

"""Clouds of several stands become one map: thin, start, align, graph, merge, picture."""

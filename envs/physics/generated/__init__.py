"""Straight-line physics, generated for one robot: the algorithms once, two back ends."""

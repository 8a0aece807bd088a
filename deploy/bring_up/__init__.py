"""A robot's first steps, one after the other, each with a measure of its own."""

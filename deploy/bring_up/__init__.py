"""First steps of a robot, each with its own test."""

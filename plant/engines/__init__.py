"""Physics engines of the simulated robot."""

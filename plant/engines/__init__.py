"""What moves the bodies of the simulated robot."""

"""A robot's parameters from its own motion: excitation, fits, held-out checks, proposals."""

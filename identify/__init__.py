"""Identifies a robot's parameters from recorded motion: excitation, fits, validation, proposals."""

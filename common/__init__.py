"""Basis of all other packages: errors, configuration, files, outputs, rotations, versions."""

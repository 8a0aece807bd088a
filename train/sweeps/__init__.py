"""Sweeps over settings and seeds on Ray Tune."""

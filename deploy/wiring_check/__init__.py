"""Finds wrong wiring before the first step: one joint after the other moves a little, and so does a model."""

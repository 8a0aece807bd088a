"""Detects wrong wiring before the first step: a model repeats small motions of the joints, one by one."""

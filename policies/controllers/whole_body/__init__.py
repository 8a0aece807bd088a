"""Whole-body control: joint torques from desired accelerations, by a weighted quadratic program."""

"""Whole-body control: joint torques from wanted accelerations, by a weighted quadratic program."""

"""Limits that several packages share."""

LONGEST_S = 86400.0  # upper limit of every time-out and duration: a day
FASTEST = 100.0  # upper limit of commands, m/s or rad/s

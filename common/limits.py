"""Limits that several packages share."""

MAX_DURATION_S = 86400.0  # upper limit of every time-out and duration: a day
MAX_COMMAND = 100.0  # upper limit of commands, m/s or rad/s

"""Limits that several packages share."""

LONGEST_S = 86400.0  # nothing that one waits for takes longer than a day

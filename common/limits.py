"""Limits that several packages share."""

LONGEST_S = 86400.0  # nothing that one waits for takes longer than a day
FASTEST = 100.0  # m/s or rad/s: no legged robot is commanded faster

"""The default robot."""

DEFAULT_ROBOT = "go1"

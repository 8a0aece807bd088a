"""Which robot is meant where none is named."""

DEFAULT_ROBOT = "go1"

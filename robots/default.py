"""The robot that is used where none is named."""

DEFAULT_ROBOT = "go1"

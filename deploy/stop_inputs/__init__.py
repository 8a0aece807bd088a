"""Devices that stop a robot from outside. Each is a `StopSource`."""

"""Devices outside the program that stop a robot. Each is a `StopSource`."""

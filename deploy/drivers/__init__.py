"""Actuator and sensor protocols: numbers to CAN frames and back, one file for each."""

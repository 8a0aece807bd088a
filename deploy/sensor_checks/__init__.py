"""Sensor checks: readings compared with each other, with the commands and with the motors' data sheets."""

"""Protocols of actuators and sensors: encoding and decoding of CAN frames, one file each."""

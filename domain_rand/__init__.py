"""What may differ: distributions over bodies, motors, sensors, delays and pushes."""

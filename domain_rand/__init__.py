"""Domain randomisation: distributions over bodies, motors, sensors and delays."""

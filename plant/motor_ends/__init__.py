"""The motors' ends of the actuator protocols, one file for each maker."""

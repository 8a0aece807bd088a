"""The simulated machine on the far side of the bus: body, motors, sensors, wires, ground truth."""

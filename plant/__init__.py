"""The simulated robot behind the bus: body, motors, sensors, wires, ground truth."""

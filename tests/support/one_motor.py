"""Three motors that differ in everything, and the first of them alone with its nominal strength."""

import numpy as np

from footfall.robots.actuator import Motor

THREE_MOTORS = Motor(
    peak_torque=np.array([20.0, 8.0, 35.0]),
    stall_torque=np.array([30.0, 9.0, 60.0]),
    no_load_speed=np.array([30.0, 50.0, 12.0]),
    friction=np.array([0.5, 0.2, 1.5]),
    friction_speed=np.array([0.2, 0.6, 0.35]),
    damping=np.array([0.05, 0.01, 0.3]),
    strength=np.array([0.9, 1.1, 0.7]),
)
ONE_MOTOR = Motor(*(values[:1] for values in THREE_MOTORS[:6]), strength=np.ones(1))

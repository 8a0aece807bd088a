"""A motor of one joint, with round numbers."""

import numpy as np

from footfall.robots.actuator import Motor

ONE_MOTOR = Motor(
    peak_torque=np.array([20.0]),
    stall_torque=np.array([30.0]),
    no_load_speed=np.array([30.0]),
    friction=np.array([0.5]),
    friction_speed=np.array([0.2]),
    damping=np.array([0.05]),
    strength=np.array([1.0]),
)

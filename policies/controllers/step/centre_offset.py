"""True position of the robot's centre of mass, from the motors' torques while it stands."""

import math

import numpy as np

from footfall.policies.controllers.whole_body.dynamics import Dynamics

MAX_OFFSET_M = 0.06  # a larger offset is due to a wrong torque, not to a load


class CentreOffset:
    """Mean horizontal offset of the true centre of mass from that of the model, while both feet are down.

    The legs' torques give the wrench of the ground on each foot, and so the centre of pressure p. A level
    body whose centre is c obeys c = p + c'' / w^2 + (L_y', -L_x') / (m g), with the pendulum's rate w and the
    angular momentum L about c. The mean of the last two terms needs only the first and the last value of
    their integral. A load, a wrong zero of an encoder and a tilted IMU all move the point over which the
    robot balances; each is part of the offset.

    Args:
        weight_n: m g.
        fall_rate: w, 1/s.
        rate_hz: rate of `observe`.
    """

    def __init__(self, weight_n: float, fall_rate: float, rate_hz: float) -> None:
        self._weight_n, self._fall_rate, self._rate_hz = weight_n, fall_rate, rate_hz
        self.reset()

    def reset(self) -> None:
        """Forget what was observed."""
        self._count, self._sum = 0, np.zeros(2)
        self._first: np.ndarray | None = None  # integral of the last two terms, at the first tick
        self.value = np.zeros(2)  # m, axes of the dynamics; zero where the legs do not determine the wrenches

    def observe(self, dynamics: Dynamics, joint_torque: np.ndarray) -> None:
        """Add a tick with both feet on the ground; joint_torque (n,) N m, as the motors report it."""
        pressure = centre_of_pressure(dynamics, joint_torque)
        if pressure is None:
            return
        momentum_x, momentum_y = (dynamics.angular_momentum[:2] / self._weight_n).tolist()
        integral = dynamics.centre_velocity[:2] / self._fall_rate**2 + np.array([momentum_y, -momentum_x])
        self._first = integral if self._first is None else self._first
        self._count += 1
        self._sum += pressure - dynamics.centre[:2]
        offset = (self._sum + (integral - self._first) * self._rate_hz) / self._count
        self.value = offset * min(1.0, MAX_OFFSET_M / max(math.hypot(*offset), 1e-9))


def centre_of_pressure(dynamics: Dynamics, joint_torque: np.ndarray) -> np.ndarray | None:
    """Centre of pressure (2,) m of all feet, axes of the dynamics, of a robot at rest.

    None if the joints do not determine the wrenches, a torque is unknown, or the total upward force is not
    positive.
    """
    feet = len(dynamics.foot)
    if not np.isfinite(joint_torque).all():
        return None
    to_joints = dynamics.foot_jacobian[:, :, 6:].reshape(6 * feet, -1).T
    wrenches, _, rank, _ = np.linalg.lstsq(to_joints, dynamics.bias[6:] - joint_torque, rcond=None)
    force, moment = wrenches.reshape(feet, 2, 3).transpose(1, 0, 2)
    up = force[:, 2]
    if rank < 6 * feet or up.sum() <= 0.0:
        return None
    arms = np.column_stack([-moment[:, 1], moment[:, 0]])
    pressure: np.ndarray = (up @ dynamics.foot[:, :2] + arms.sum(axis=0)) / up.sum()
    return pressure

"""A momentum observer: forces on a robot's limbs from joint readings.

De Luca et al. 2006, "Collision detection and safe reaction with the DLR-III lightweight manipulator arm".
A force f at the foot causes the change of a limb's momentum that motor torques and the limb's weight (under
the base's proper acceleration) do not explain,

    J' f = d(M q')/dt + weight - torque.

Without the first term a leg that accelerates in swing would look like a stance leg. Without the second a
heavy stance leg would look like a swing leg.
"""

import numpy as np

from footfall.common.linear import solve_regular
from footfall.robots.kinematics import Legs
from footfall.robots.readings import Sensed

_REGULARISATION = 1e-5 * np.eye(3)  # m^2/rad^2


def external_torque(legs: Legs, sensed: Sensed, motor_torque: np.ndarray) -> np.ndarray:
    """External torque on each joint, N m, (legs, m): weight - torque.

    Args:
        legs: legs of the robot.
        sensed: the readings.
        motor_torque: (n,) N m, torque of the motors, plus gearbox friction where it is known.
    """
    return legs.holding_torque(sensed.joint_position, sensed.acceleration) - legs.gather(motor_torque)


def upward_force(jacobian: np.ndarray, torque: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Upward force at each foot, N, (legs, k), that causes k sets of torques.

    Least squares, regularised: near a singular pose the force is unknown in one direction only.

    Args:
        jacobian: (legs, 3, m) of the points of contact, base frame.
        torque: (legs, m, k) at the joints, N m.
        up: (3,) vertical, base frame.
    """
    regularised = jacobian @ jacobian.transpose(0, 2, 1) + _REGULARISATION
    force: np.ndarray = up @ solve_regular(regularised, jacobian @ torque)
    return force


class MomentumObserver:
    """The two parts of the torque at the limbs' joints, both through the same first-order filter.

    The filter also gives the derivative of the momentum: its lag is its time constant times the rate of
    change. With backward Euler steps this is exact.

    Args:
        inertia: (legs, m, m) kg m^2, in joint space.
        filter_s: time constant.
    """

    def __init__(self, inertia: np.ndarray, filter_s: float) -> None:
        self._inertia, self._filter_s = inertia, filter_s

    def reset(self, external: np.ndarray, rates: np.ndarray) -> None:
        """Reset, assuming joints that do not accelerate; arguments as for `update`."""
        self._filtered = _stacked(external, self._momentum(rates))

    def update(self, external: np.ndarray, rates: np.ndarray, dt_s: float) -> np.ndarray:
        """Process one set of readings of the same time.

        Args:
            external: (legs, m) N m, see `external_torque`.
            rates: (legs, m) rad/s, of the joints.
            dt_s: time since the previous readings.

        Returns:
            (legs, m, 2) N m: filtered `external`, and the rate of change of the momentum.
        """
        momentum = self._momentum(rates)
        share = dt_s / (self._filter_s + dt_s)
        self._filtered += share * (_stacked(external, momentum) - self._filtered)
        rate = (momentum - self._filtered[:, :, 1]) / self._filter_s
        return _stacked(self._filtered[:, :, 0], rate)

    def _momentum(self, rates: np.ndarray) -> np.ndarray:
        """Momentum of each limb's joints, N m s, (legs, m)."""
        return (self._inertia @ rates[:, :, None])[:, :, 0]


def _stacked(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Two arrays (legs, m) as one, (legs, m, 2): as `numpy.stack`, in a third of the time."""
    both = np.empty((*first.shape, 2))
    both[:, :, 0], both[:, :, 1] = first, second
    return both

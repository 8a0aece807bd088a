"""Reference motion for model-predictive control: a pose ahead of the base, and its continuation."""

import cmath

import numpy as np

from footfall.common.rotations import wrap_angle
from footfall.policies.controllers.mpc.base import Base
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.problem import BodyState

_DECAY_S = 0.2  # time constant with which the body is expected to lose excess speed


class Reference:
    """A reference pose that moves at the commanded velocity, at a bounded distance from the base.

    Args:
        config: settings of the controller.
        centre_of_mass: (3,) m, in the base's frame.
    """

    def __init__(self, config: MpcConfig, centre_of_mass: np.ndarray) -> None:
        self._stance, self._settle_s = config.stance, config.settle_s
        self._step_s = config.horizon.step_s
        self._centre = centre_of_mass
        steps = config.horizon.steps
        self._end_of_step = self._step_s * np.arange(1, steps + 1)
        self.middle_of_step = self._step_s * (np.arange(steps) + 0.5)  # s from now, (steps,)
        decayed_s = _DECAY_S * (1.0 - np.exp(-self.middle_of_step / _DECAY_S))
        self._path_basis = np.column_stack([np.ones(steps), self.middle_of_step, decayed_s])
        self.begin(0.0, config.stance.height_m)

    def begin(self, yaw: float, height: float) -> None:
        """Start at the origin of the world, at rest."""
        self.xy = self.velocity = 0j  # m and m/s, world, x + i y
        self.yaw, self.height = yaw, height  # rad, m
        self.requested_height = self._stance.height_m
        self.attitude = np.zeros(2)  # roll and pitch, rad

    def advance(self, base: Base, command: np.ndarray, dt_s: float) -> None:
        """Move by the command (3,): forward m/s, leftward m/s, yaw rad/s."""
        stance = self._stance
        forward, leftward, yaw_rate = command.tolist()
        self.velocity = complex(forward, leftward) * cmath.rect(1.0, base.yaw)
        lead = self.xy + self.velocity * dt_s - base.xy
        limit = stance.max_position_lead_m
        self.xy = base.xy + (lead if abs(lead) <= limit else lead * (limit / abs(lead)))
        yaw_lead = wrap_angle(self.yaw + yaw_rate * dt_s - base.yaw)
        limit = stance.max_yaw_lead_rad
        self.yaw = base.yaw + min(limit, max(-limit, yaw_lead))
        height_error = self.requested_height - self.height
        self.height += min(1.0, dt_s / self._settle_s) * height_error

    def over_horizon(self, base: Base, command: np.ndarray) -> BodyState:
        """Commanded motion after each step of the horizon, (steps, 6) each, in the heading frame."""
        forward, leftward, yaw_rate = command.tolist()
        times_s = self._end_of_step
        yaw = wrap_angle(self.yaw - base.yaw) + yaw_rate * times_s
        heading = np.exp(1j * yaw)
        velocity = heading * complex(forward, leftward)
        lead = (self.xy - base.xy) * cmath.rect(1.0, -base.yaw)
        centre_x, centre_y, centre_z = self._centre.tolist()
        xy = lead + velocity.cumsum() * self._step_s
        xy += heading * complex(centre_x, centre_y)
        pose, rate = np.zeros((len(times_s), 6)), np.zeros((len(times_s), 6))
        pose[:, :2] = self.attitude
        pose[:, 2], rate[:, 2] = yaw, yaw_rate
        pose[:, 3], pose[:, 4] = xy.real, xy.imag
        rate[:, 3], rate[:, 4] = velocity.real, velocity.imag
        pose[:, 5] = self.height + centre_z
        return BodyState(pose, rate)

    def path(self, state: BodyState, reference: BodyState) -> np.ndarray:
        """Centre of mass (steps, 3), m, in the middle of each step; its velocity decays to
        that of the reference."""
        (x, y, z), (forward, leftward, _) = state.pose[3:].tolist(), state.rate[3:].tolist()
        desired_x, desired_y, _ = reference.rate[0, 3:].tolist()
        rows = [[x, y, z], [desired_x, desired_y, 0.0], [forward - desired_x, leftward - desired_y, 0.0]]
        return self._path_basis.dot(np.array(rows))

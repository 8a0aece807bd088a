"""MuJoCo Playground's Go1 policy as a footfall policy, with the same joint layer and motor frames.

The observation is that of `Joystick._get_obs` in Playground 0.2.0, without its noise. The base's velocity
comes from the simulator, because no robot can measure it. All other entries come from the simulated sensors.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

RATE_HZ = 50.0


@dataclass(frozen=True)
class SavedActors:
    """Policies saved by `playground_training.py` during training, with their settings."""

    time_s: np.ndarray  # (k,) since the start of the training's command
    steps: np.ndarray  # (k,) environment steps
    actors: tuple[tuple[np.ndarray, ...], ...]  # mean, deviation, then kernel and bias of each layer
    joints: tuple[str, ...]  # in the actors' order
    default_pose: np.ndarray  # (n,) rad
    kp: float  # N m/rad
    kd: float  # N m s/rad
    action_scale: float  # rad


def load_actors(path: Path) -> SavedActors:
    """Read a file of `playground_training.py`."""
    with np.load(path) as file:
        count = len(file["time_s"])
        parts = 1 + max(int(name.split("/")[1]) for name in file.files if name.startswith("0/"))
        actors = tuple(tuple(file[f"{k}/{part}"] for part in range(parts)) for k in range(count))
        return SavedActors(
            file["time_s"],
            file["steps"],
            actors,
            tuple(str(name) for name in file["joints"]),
            file["default_pose"],
            *(float(file[name]) for name in ("kp", "kd", "action_scale")),
        )


class PlaygroundPolicy:
    """One of the saved actors, on a robot whose joints have the same names."""

    contract = None
    notes = ()
    rate_hz = RATE_HZ
    needs_estimate = True

    def __init__(self, saved: SavedActors, index: int, robot: Robot) -> None:
        self.name = f"playground after {saved.time_s[index]:.0f} s"
        mean, deviation, *layers = saved.actors[index]
        self._mean, self._deviation = mean, deviation
        self._layers = list(zip(layers[::2], layers[1::2], strict=True))
        self._order = np.array([robot.joint_index(name) for name in saved.joints])
        self._inverse_order = np.argsort(self._order)
        self._saved, self._count = saved, len(saved.joints)
        self._last_action = np.zeros(self._count)

    def reset(self, inputs: PolicyInput) -> None:
        self._last_action = np.zeros(self._count)

    def act(self, inputs: PolicyInput) -> JointCommand:
        saved, sensed = self._saved, inputs.sensed
        w, x, y, z = sensed.quaternion
        gravity = [2 * (w * y - x * z), -2 * (w * x + y * z), 2 * (x * x + y * y) - 1]
        state = np.concatenate(
            [
                inputs.base_velocity,
                sensed.gyro,
                gravity,
                sensed.joint_position[self._order] - saved.default_pose,
                sensed.joint_velocity[self._order],
                self._last_action,
                inputs.command,
            ]
        )
        self._last_action = action = self._actor(state)
        target = (saved.default_pose + saved.action_scale * action)[self._inverse_order]
        zeros = np.zeros(self._count)
        return JointCommand(
            target, zeros, np.full(self._count, saved.kp), np.full(self._count, saved.kd), zeros
        )

    def stance(self) -> None:
        """None: the policy has no contact plan."""

    def _actor(self, state: np.ndarray) -> np.ndarray:
        """Mode of the action distribution, in [-1, 1]: a swish network, then tanh of the mean."""
        x = (state - self._mean) / self._deviation
        for index, (kernel, bias) in enumerate(self._layers):
            x = x @ kernel + bias
            if index < len(self._layers) - 1:
                x = x / (1.0 + np.exp(-x))
        return np.tanh(x[: self._count])

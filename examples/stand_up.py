"""Example of a task: the robot rises from a crouch within a second, gently.

    footfall train --robot go1 --preset stand_up.yaml --out runs/stand_up

The preset lists every term of the task. Two of them are here: the start of an episode, and the reward for the
planned height. There is no velocity command and no gait.
"""

from dataclasses import dataclass
from typing import Annotated

import jax
import jax.numpy as jnp
import numpy as np

from footfall.common.terms import Between
from footfall.envs.state import State
from footfall.envs.terms.data import StepData
from footfall.envs.terms.events import Occasion, event_term
from footfall.robots.description import Robot

Share = Annotated[float, Between(0.1, 1.0)]


def crouch_pose(robot: Robot, share: float) -> np.ndarray:
    """Joint positions (n,), rad, for a base at a share of its standing height, with the feet in place."""
    legs = robot.legs
    foot = legs.default_foot.copy()  # (feet, 3) m, in the base frame
    foot[:, 2] += (1.0 - share) * robot.description.standing_height_m
    return legs.scatter(legs.solve(foot), robot.default_pose)


@event_term(numbers=1)
def crouch(state: State, occasion: Occasion, *, lowest: Share = 0.5, highest: Share = 0.8) -> State:
    """Start an episode crouched, at a random share of the standing height, with motors that hold the pose."""
    scene = occasion.scene
    shares = np.linspace(lowest, highest, 16)
    poses = jnp.asarray(np.stack([crouch_pose(scene.robot, share) for share in shares]), jnp.float32)
    chosen = jnp.int32(len(shares) * occasion.u[0])
    pose, height_m = poses[chosen], jnp.asarray(shares, jnp.float32)[chosen] * scene.standing_height
    qpos = state.qpos.at[scene.positions].set(pose, unique_indices=True)
    crouched = state._replace(target=pose, goals=jnp.tile(pose, (len(state.goals), 1)))
    return crouched._replace(qpos=scene.base.at_height(qpos, height_m))


@dataclass(frozen=True)
class Rise:
    """1 with the base at the planned height, which rises uniformly from the crouch to standing."""

    duration_s: Annotated[float, Between(0.1, 10.0)] = 1.0
    sigma_m: Annotated[float, Between(1e-3, 1.0)] = 0.03

    def init(self, data: StepData) -> tuple[jax.Array, jax.Array]:
        """State of the term at the start of an episode: height of the crouch, m, and time, s."""
        return data.height, jnp.float32(0.0)

    def step(self, state: tuple[jax.Array, jax.Array], data: StepData) -> tuple[tuple, jax.Array]:
        """State after a control step, and the reward."""
        crouch_m, time_s = state[0], state[1] + data.period_s
        share = jnp.minimum(time_s / self.duration_s, 1.0)
        planned_m = crouch_m + share * (data.scene.standing_height - crouch_m)
        return (crouch_m, time_s), jnp.exp(-(((data.height - planned_m) / self.sigma_m) ** 2))

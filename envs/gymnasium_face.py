"""The environment behind gymnasium's interfaces: one episode, or many side by side."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import gymnasium
import jax
import mujoco
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from envs.batch import step_batch
from envs.config import EnvConfig
from envs.velocity import State, VelocityEnv
from robots.description import Robot
from robots.errors import UserError
from robots.model import plant_model

WIDTH, HEIGHT = 480, 320


class GymnasiumEnv(gymnasium.Env):
    """One robot. An observation is what the actor sees; an action is what a policy gives."""

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012, gymnasium's own form

    def __init__(self, robot: Robot, config: EnvConfig, render_mode: str | None = None) -> None:
        """Compile nothing yet; the first reset and the first step do.

        Raises:
            UserError: the configuration or the render mode does not fit.
        """
        self.env = env = VelocityEnv(robot, config)
        self.observation_space, self.action_space = spaces(env)
        self.render_mode = checked(render_mode)
        self.metadata = self.metadata | {"render_fps": round(config.control_rate_hz)}
        self._reset, self._step = jax.jit(env.reset), jax.jit(env.step)
        self._camera = Camera(robot)
        self._state: State | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode. There are no options."""
        super().reset(seed=seed)
        self._state, observation = self._reset(draw_key(self.np_random))
        return np.array(observation["state"]), {"command": np.array(self._state.command)}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One control step. The command in the information is the one that the observation holds."""
        if self._state is None:
            raise gymnasium.error.ResetNeeded("reset the environment before its first step")
        self._state, step = self._step(self._state, np.asarray(action, np.float32))
        info: dict[str, Any] = {"command": np.array(self._state.command)}
        info |= {name: float(value) for name, value in tracking(step.metrics).items()}
        observation, ended = np.array(step.observation["state"]), bool(step.terminated)
        return observation, float(step.reward), ended, bool(step.truncated), info

    def render(self) -> np.ndarray | None:
        """The robot as it stands, (height, width, 3) bytes, if made with render mode rgb_array."""
        if self.render_mode is None or self._state is None:
            return None
        return self._camera.picture(np.asarray(self._state.qpos))

    def close(self) -> None:
        """Let go of the renderer."""
        self._camera.close()


class GymnasiumVectorEnv(VectorEnv):
    """Many robots at once. Where an episode ends, the same step begins the next.

    The last observation of one that ended is in the information, as "final_obs".
    """

    metadata = {"render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self, robot: Robot, config: EnvConfig, num_envs: int = 1, render_mode: str | None = None
    ) -> None:
        """Compile nothing yet; the first reset and the first step do.

        Raises:
            UserError: the configuration, the number or the render mode does not fit.
        """
        if num_envs < 1:
            raise UserError(f"num_envs must be at least 1, not {num_envs}")
        self.env = env = VelocityEnv(robot, config)
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = spaces(env)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.render_mode = checked(render_mode)
        self.metadata = self.metadata | {"render_fps": round(config.control_rate_hz)}
        self._reset, self._step = jax.jit(jax.vmap(env.reset)), jax.jit(partial(step_batch, env))
        self._camera = Camera(robot)
        self._state: State | None = None

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin all episodes. A number seeds environment k with seed + k, as gymnasium's own do."""
        if isinstance(seed, int):
            super().reset(seed=seed)
            seed = range(seed, seed + self.num_envs)
        seeds = [None] * self.num_envs if seed is None else seed
        generators = [self.np_random if one is None else seeding.np_random(one)[0] for one in seeds]
        self._state, observation = self._reset(np.stack([draw_key(generator) for generator in generators]))
        return np.array(observation["state"]), {"command": np.array(self._state.command)}

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One control step of all."""
        if self._state is None:
            raise gymnasium.error.ResetNeeded("reset the environments before their first step")
        self._state, observation, step = self._step(self._state, np.asarray(actions, np.float32))
        info = {"command": np.array(self._state.command)}
        info |= {name: np.array(value) for name, value in tracking(step.metrics).items()}
        ended = np.asarray(step.metrics["done"]) > 0
        if ended.any():
            info |= {"final_obs": np.array(step.observation["state"]), "_final_obs": ended}
        return (
            np.array(observation["state"]),
            np.array(step.reward),
            np.asarray(step.terminated) > 0,
            np.asarray(step.truncated) > 0,
            info,
        )

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A picture of each robot, if made with render mode rgb_array."""
        if self.render_mode is None or self._state is None:
            return None
        return tuple(self._camera.picture(qpos) for qpos in np.asarray(self._state.qpos))

    def close_extras(self, **_: Any) -> None:
        """Let go of the renderer."""
        self._camera.close()


class Camera:
    """Pictures of a robot, from a camera that goes along. Nothing is set up before the first."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._renderer: mujoco.Renderer | None = None

    def picture(self, qpos: np.ndarray) -> np.ndarray:
        """The robot in this position, (height, width, 3) bytes."""
        if self._renderer is None:
            self._model = plant_model(self._robot)
            self._data, self._view = mujoco.MjData(self._model), mujoco.MjvCamera()
            self._renderer = mujoco.Renderer(self._model, HEIGHT, WIDTH)
        self._data.qpos[:] = qpos
        mujoco.mj_forward(self._model, self._data)
        self._view.lookat[:] = qpos[:3]
        self._view.distance = 5 * self._robot.description.standing_height_m
        self._renderer.update_scene(self._data, self._view)
        return self._renderer.render().copy()

    def close(self) -> None:
        """Free the renderer's memory; another picture takes it again."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def spaces(env: VelocityEnv) -> tuple[Box, Box]:
    """Observation and action space. Beyond the actions' bounds, targets end at the soft limits anyway."""
    robot = env.robot
    reach = np.maximum(*(np.abs(limit - robot.default_pose) for limit in robot.soft_limits))
    bound = (reach / robot.action_scale).astype(np.float32)
    return Box(-np.inf, np.inf, (env.observation_sizes["state"],), np.float32), Box(-bound, bound)


def draw_key(generator: np.random.Generator) -> np.ndarray:
    """A key for JAX, shape (2,)."""
    return generator.integers(2**32, size=2, dtype=np.uint32)


def tracking(metrics: dict[str, jax.Array]) -> dict[str, jax.Array]:
    """The tracking errors among a step's metrics, without their group's name."""
    group = "tracking/"
    return {name.removeprefix(group): value for name, value in metrics.items() if name.startswith(group)}


def checked(render_mode: str | None) -> str | None:
    """A render mode that there is.

    Raises:
        UserError: there is no such mode.
    """
    if render_mode not in (None, *GymnasiumEnv.metadata["render_modes"]):
        raise UserError(f"no render mode '{render_mode}': there is rgb_array")
    return render_mode

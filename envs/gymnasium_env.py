"""The environment with gymnasium's interfaces: one episode, or many in parallel."""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import gymnasium
import jax
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from footfall.common.errors import UserError
from footfall.envs.batch import restart_of, step_batch
from footfall.envs.camera import Camera
from footfall.envs.config import EnvConfig
from footfall.envs.environment import Environment
from footfall.envs.make import make_environment
from footfall.envs.state import State, Step
from footfall.robots.description import Robot

TRACKING = "tracking/"  # metrics of this group are part of gymnasium's info


class EpisodesWithInfo(NamedTuple):
    """The same episodes, but a step's metrics are the content of gymnasium's info."""

    env: Environment

    @property
    def on_host(self) -> bool:
        """Same as the environment's."""
        return self.env.on_host

    def reset(self, key: jax.Array, level: jax.Array | float = 1.0) -> tuple[State, dict[str, jax.Array]]:
        """Same as the environment's."""
        return self.env.reset(key, level)

    def restart(self, state: State) -> tuple[State, dict[str, jax.Array]]:
        """Same as the environment's."""
        return restart_of(self.env)(state)

    def step(self, state: State, action: jax.Array) -> tuple[State, Step]:
        """One step; its metrics are the "command" (3,) after the step and the tracking errors."""
        state, step = self.env.step(state, action)
        errors = {k.removeprefix(TRACKING): v for k, v in step.metrics.items() if k.startswith(TRACKING)}
        return state, step._replace(metrics={"command": state.command} | errors)


class StepResult(NamedTuple):
    """The results of a step that Python reads, of one robot or with a leading axis (environments,)."""

    observation: Any  # the actor's
    reward: Any
    terminated: Any  # bool
    truncated: Any  # bool
    info: dict[str, Any]


class GymnasiumEnv(gymnasium.Env):
    """One robot. Observations are the actor's; actions are a policy's."""

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012, gymnasium's own form

    def __init__(self, robot: Robot, config: EnvConfig, render_mode: str | None = None) -> None:
        """Compile nothing yet; the first reset and the first step do.

        Raises:
            UserError: the configuration or the render mode does not fit.
        """
        self.env = env = make_environment(robot, config)
        self.observation_space, self.action_space = spaces(env)
        self.render_mode = checked_mode(render_mode)
        self.metadata = self.metadata | {"render_fps": round(config.control_rate_hz)}
        self._reset = jax.jit(partial(reset_one, env))
        self._step = jax.jit(partial(step_one, EpisodesWithInfo(env)), donate_argnums=0)
        self._camera = Camera(robot)
        self.state: State | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode.

        Raises:
            UserError: an option was given; there are none.
        """
        refuse_options(options)
        super().reset(seed=seed)
        self.state, *outputs = self._reset(draw_key(self.np_random))
        observation, command = map(np.array, outputs)  # copies: the next step reuses the state's memory
        return observation, {"command": command}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One control step."""
        if self.state is None:
            raise gymnasium.error.ResetNeeded("reset the environment before its first step")
        self.state, result = self._step(self.state, np.asarray(action, np.float32))
        info = {name: np.array(value) if value.ndim else float(value) for name, value in result.info.items()}
        ended = bool(result.terminated), bool(result.truncated)
        return np.array(result.observation), float(result.reward), *ended, info

    def render(self) -> np.ndarray | None:
        """The robot as it stands, (height, width, 3) bytes, if made with render mode rgb_array."""
        if self.render_mode is None or self.state is None:
            return None
        return self._camera.picture(np.asarray(self.state.qpos))

    def close(self) -> None:
        """Free the renderer."""
        self._camera.close()


class GymnasiumVectorEnv(VectorEnv):
    """Many robots in parallel. When an episode ends, the same step begins the next one.

    The last observation and info of an ended episode are in the info as "final_obs" and "final_info".
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
        self.env = env = make_environment(robot, config)
        self.num_envs = num_envs
        self._generators = [seeding.np_random() for _ in range(num_envs)]
        self.single_observation_space, self.single_action_space = spaces(env)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.render_mode = checked_mode(render_mode)
        self.metadata = self.metadata | {"render_fps": round(config.control_rate_hz)}
        self._reset = jax.jit(jax.vmap(partial(reset_one, env)))
        self._step = jax.jit(partial(step_many, EpisodesWithInfo(env)), donate_argnums=0)
        self._camera = Camera(robot)
        self.state: State | None = None

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin all episodes. A number seeds environment k with seed + k, as gymnasium's own environments do.

        Each environment has a generator of its own, which lasts until its next seed.

        Raises:
            UserError: an option was given; there are none, not even "reset_mask".
            ValueError: there is not one seed for each environment.
        """
        refuse_options(options)
        if seed is None or isinstance(seed, int):
            seed = [None if seed is None else seed + k for k in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"{len(seed)} seeds for {self.num_envs} environments")
        self._generators = [
            generator if each is None else seeding.np_random(each)
            for generator, each in zip(self._generators, seed, strict=True)
        ]
        self.state, *outputs = self._reset(np.stack([draw_key(generator) for generator in self.np_random]))
        observations, commands = map(np.array, outputs)
        return observations, masked({"command": commands}, np.ones(self.num_envs, bool))

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The generator of each environment, as gymnasium's own vector environments return them."""
        return tuple(generator for generator, _ in self._generators)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The last seed of each environment's generator."""
        return tuple(seed for _, seed in self._generators)

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One control step of all robots."""
        if self.state is None:
            raise gymnasium.error.ResetNeeded("reset the environments before their first step")
        self.state, *outputs = self._step(self.state, np.asarray(actions, np.float32))
        observations, commands, result = jax.tree.map(np.array, outputs)
        info = vector_info(result, commands)
        return observations, result.reward, result.terminated, result.truncated, info

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A picture of each robot, if made with render mode rgb_array."""
        if self.render_mode is None or self.state is None:
            return None
        return tuple(self._camera.picture(qpos) for qpos in np.asarray(self.state.qpos))

    def close_extras(self, **_: Any) -> None:
        """Free the renderer."""
        self._camera.close()


def spaces(env: Environment) -> tuple[Box, Box]:
    """Observation and action space. The action bounds reach the soft limits, where targets are clamped."""
    robot = env.robot
    reach = np.maximum(*(np.abs(limit - robot.default_pose) for limit in robot.soft_limits))
    bound = (reach / np.array(env.contract.action_scale_rad)).astype(np.float32)
    return Box(-np.inf, np.inf, (env.observation_sizes["state"],), np.float32), Box(-bound, bound)


def draw_key(generator: np.random.Generator) -> np.ndarray:
    """A key for JAX, shape (2,)."""
    return generator.integers(2**32, size=2, dtype=np.uint32)


def reset_one(env: Environment, key: jax.Array) -> tuple[State, jax.Array, jax.Array]:
    """A new episode: state, observation, and its command (3,)."""
    state, observation = env.reset(key)
    return state, observation["state"], state.command


def step_one(env: EpisodesWithInfo, state: State, action: jax.Array) -> tuple[State, StepResult]:
    """A control step of one robot."""
    state, step = env.step(state, action)
    return state, step_result(step)


def step_many(
    env: EpisodesWithInfo, state: State, actions: jax.Array
) -> tuple[State, jax.Array, jax.Array, StepResult]:
    """A control step of all robots: next state, observations and commands, and the result of the step."""
    state, observation, step = step_batch(env, state, actions)
    return state, observation["state"], state.command, step_result(step)


def step_result(step: Step) -> StepResult:
    """The results of a step that Python reads: the compiler drops all computations for the others."""
    info = {name: value for name, value in step.metrics.items() if name not in ("done", "length")}
    return StepResult(step.observation["state"], step.reward, step.terminated > 0, step.truncated > 0, info)


def vector_info(result: StepResult, commands: np.ndarray) -> dict[str, Any]:
    """The info of a step, in the form of gymnasium's own vector environments.

    Args:
        result: results of the step; where an episode ended, of its last step.
        commands: the next commands, shape (environments, 3); a new episode's where one ended.
    """
    ended = result.terminated | result.truncated
    errors = {name: value for name, value in result.info.items() if name != "command"}
    info: dict[str, Any] = masked({"command": commands}, np.ones_like(ended)) | masked(errors, ~ended)
    if ended.any():
        observations = np.full(len(ended), None)  # objects: a wrapper may change their shape
        for k in np.flatnonzero(ended):
            observations[k] = result.observation[k].copy()
        info |= {"final_obs": observations, "_final_obs": ended.copy()}
        info |= {"final_info": masked(result.info, ended), "_final_info": ended.copy()}
    return info


def masked(values: dict[str, np.ndarray], mask: np.ndarray) -> dict[str, np.ndarray]:
    """Values (environments, ...) where a mask (environments,) holds, else 0; each with the mask as _name."""
    selected = {name: np.where(mask.reshape(-1, *[1] * (x.ndim - 1)), x, 0) for name, x in values.items()}
    return selected | {f"_{name}": mask.copy() for name in values}


def refuse_options(options: dict[str, Any] | None) -> None:
    """Check that a reset has no options.

    Raises:
        UserError: it has one.
    """
    if options:
        raise UserError(f"a reset has no options: {', '.join(options)}")


def checked_mode(render_mode: str | None) -> str | None:
    """The render mode, if it exists.

    Raises:
        UserError: there is no such mode.
    """
    if render_mode not in (None, *GymnasiumEnv.metadata["render_modes"]):
        raise UserError(f"no render mode '{render_mode}': there is rgb_array")
    return render_mode

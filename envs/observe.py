"""The actor's observation: readings with delay, bias and noise, in a history."""

import jax
import jax.numpy as jnp
import mujoco

from footfall.common.rotations import multiply, turn_down
from footfall.domain_rand.noise import biased, noisy
from footfall.domain_rand.randomisation import refuse_unread_sensors, require_delays
from footfall.domain_rand.transport import transport_of
from footfall.envs.base import Base
from footfall.envs.config import EnvConfig
from footfall.envs.delays import delayed_readings
from footfall.envs.height_scan import Heights, Scanner
from footfall.envs.physics.interface import GRAVITY
from footfall.envs.random_numbers import split
from footfall.envs.state import State
from footfall.envs.terms.data import level_ground
from footfall.policies.contract import Contract
from footfall.policies.height_scan import height_scan_of
from footfall.policies.observation import (
    Inputs,
    history_length,
    observation,
    push_history,
    size_per_step,
    step_values,
)
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses
from footfall.robots.readings import Sensed, as_vector, from_vector, read, readings_size


class Observer:
    """Observes a state as a policy on the robot would."""

    def __init__(self, model: mujoco.MjModel, robot: Robot, config: EnvConfig, contract: Contract) -> None:
        """Raises UserError if a reading may be delayed for too long, or is randomised but not simulated."""
        require_delays(config.randomisation, "readings", 1.0 / config.control_rate_hz)
        refuse_unread_sensors(config.randomisation)
        self._positions, self._dofs = joint_addresses(model, robot)
        self._base, self._contract = Base(model, robot), contract
        self._noise, self._timestep_s = config.noise, config.timestep_s
        self._joints = len(robot.joint_names)
        scan, errors = height_scan_of(contract), config.height_scan_errors
        self._scanner = (
            None if scan is None else Scanner(scan, errors, self._base, 1.0 / config.control_rate_hz)
        )
        self._sizes = readings_size(self._joints), 0 if self._scanner is None else self._scanner.numbers
        self.numbers = sum(self._sizes)  # uniform numbers that `observe` takes

    def readings(
        self, qpos: jax.Array, qvel: jax.Array, torque: jax.Array, gravity: jax.Array | None = None
    ) -> jax.Array:
        """The true readings at one instant, concatenated (robots/readings.py).

        Args:
            qpos, qvel: positions (nq,) and velocities (nv,).
            torque: torque of the motors, N m, shape (n,).
            gravity: gravity in the world frame, (3,), to which an IMU aligns its attitude; None: downwards.
        """
        quaternion = self._base.quaternion(qpos)
        if gravity is not None:
            quaternion = multiply(turn_down(gravity), quaternion)
        sensed = Sensed(
            gyro=self._base.angular_velocity(qvel),
            acceleration=None,
            quaternion=quaternion,
            joint_position=qpos[self._positions],
            joint_velocity=qvel[self._dofs],
            joint_torque=torque,
        )
        return as_vector(read(sensed))

    def empty_history(self) -> jax.Array:
        """Empty history before the first observation, shape (history, size_per_step)."""
        return jnp.zeros((history_length(self._contract), size_per_step(self._contract)))

    def observe(
        self,
        state: State,
        recent: jax.Array,
        u: jax.Array,
        ground: Heights = level_ground,
        is_reset: bool = False,
        lateness_s: jax.Array | None = None,
    ) -> tuple[State, jax.Array]:
        """The state with the newest values in its history, and the actor's observation.

        Args:
            state: after the control step; its last action, command and phase are part of the observation.
            recent: readings after each of the last physics steps, oldest first, shape (k, numbers).
            u: uniform numbers for the noise, shape (numbers,).
            ground: height of the ground at positions in the world.
            is_reset: whether an episode begins; its first values then fill the whole history.
            lateness_s: delay of each number in this step, s, (numbers,); None: the sample's constant delay.
        """
        delay_s = transport_of(state.sample, "readings").delay_s if lateness_s is None else lateness_s
        delayed = delayed_readings(recent, delay_s, self._timestep_s)
        noise, scan_numbers = split(u, *self._sizes)
        readings = noisy(biased(from_vector(delayed, self._joints), state.sample), self._noise, noise)
        heights = None
        if self._scanner is not None:
            state, heights = self._scanner.deliver(state, ground, scan_numbers, is_reset)
        newest = step_values(
            Inputs(readings, state.actions[0], state.command, state.phase, heights), self._contract
        )
        history = (
            jnp.broadcast_to(newest, state.history.shape) if is_reset else push_history(state.history, newest)
        )
        return state._replace(history=history), observation(history, self._contract)

    def clean_values(self, state: State, torque: jax.Array, ground: Heights = level_ground) -> jax.Array:
        """Observation values without delay, bias and noise, for the critic."""
        vector = self.readings(state.qpos, state.qvel, torque, state.fields.get(GRAVITY))
        readings = from_vector(vector, self._joints)
        heights = None if self._scanner is None else self._scanner.exact(state, ground)
        return step_values(
            Inputs(readings, state.actions[0], state.command, state.phase, heights), self._contract
        )

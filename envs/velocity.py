"""Velocity tracking on flat ground: a functional environment.

`reset(key)` and `step(state, action)` are pure and concern one robot; `jax.vmap` makes them many.
"""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.common.rotations import multiply, normalised, projected_gravity, rotate_to_body
from footfall.domain_rand.bodies import body_map, randomised_field_names, randomised_fields
from footfall.domain_rand.noise import biased, noisy
from footfall.domain_rand.sample import (
    Sample,
    draw,
    randomised_command,
    randomised_motor,
    sensor_bias,
    towards_nominal,
)
from footfall.envs.commands import COMMAND_NUMBERS, draw_command, draw_hold_steps
from footfall.envs.config import EnvConfig
from footfall.envs.critic import Truth, critic_observation
from footfall.envs.delays import delayed_goals, delayed_readings
from footfall.envs.gait import make_gait
from footfall.envs.physics import Drive, Motion, Physics, Trace
from footfall.envs.physics_c import c_physics
from footfall.envs.physics_mjx import mjx_physics
from footfall.envs.rewards import TERMS as REWARD_TERMS
from footfall.envs.rewards import Outcome, reward_rate, rewards
from footfall.policies.action import joint_target
from footfall.policies.contract import Contract
from footfall.policies.observation import (
    Inputs,
    frame,
    frame_size,
    history_length,
    moving,
    observation,
    push_frame,
)
from footfall.robots.actuator import JointCommand, Motor
from footfall.robots.description import Robot
from footfall.robots.model import ground_friction, joint_addresses, training_model
from footfall.robots.readings import Sensed, as_vector, from_vector, read, readings_size
from footfall.robots.targets import limit_target

KEPT_GOALS = 3  # control steps whose targets may still be on their way to the motors
PUSH_NUMBERS = 6  # uniform numbers that a push is drawn from
DISTURBANCE_NUMBERS = COMMAND_NUMBERS + PUSH_NUMBERS + 2
CONTACT_CLEARANCE_M = 0.002  # a foot closer to the ground counts as touching
PHYSICS: dict[str, Callable[[mujoco.MjModel, Robot], Physics]] = {"mjx": mjx_physics, "c": c_physics}


class State(NamedTuple):
    """All that an episode is, for one robot. `_replace` gives the next one."""

    key: jax.Array
    level: jax.Array  # () of the curriculum, 0 to 1
    qpos: jax.Array
    qvel: jax.Array
    qacc_warmstart: jax.Array
    sample: Sample
    fields: dict[str, jax.Array]  # randomised model fields
    command: jax.Array  # (3,)
    hold_steps: jax.Array  # () control steps until the next command
    push_steps: jax.Array  # () control steps until the next push
    steps: jax.Array  # () control steps since the reset
    phase: jax.Array  # (1,) cycles
    actions: jax.Array  # (3, n) newest first
    goals: jax.Array  # (KEPT_GOALS, n) newest first, rad
    target: jax.Array  # (n,) rate-limited target, rad
    trail: jax.Array  # (substeps, m) readings after each physics step, oldest first
    frames: jax.Array  # (history, frame)


class Step(NamedTuple):
    """What a step hands to the learner."""

    observation: dict[str, jax.Array]  # "state" for the actor, "privileged_state" for the critic
    reward: jax.Array
    terminated: jax.Array  # 1.0 after a fall or a diverged simulation
    truncated: jax.Array  # 1.0 at the episode's time limit
    metrics: dict[str, jax.Array]


def make_contract(robot: Robot, config: EnvConfig) -> Contract:
    """The contract of policies that are trained on this robot with these settings."""
    return Contract(
        robot=robot.name,
        digest=robot.digest,
        joints=robot.joint_names,
        control_rate_hz=config.control_rate_hz,
        observation=config.observation,
        default_pose_rad=tuple(robot.default_pose.tolist()),
        action_scale_rad=tuple(robot.action_scale.tolist()),
        kp=tuple(robot.kp.tolist()),
        kd=tuple(robot.kd.tolist()),
        commands=config.commands.ranges,
        gait=make_gait(robot, config.gait) if config.gait else None,
        standing_command=config.commands.standing_command,
    )


class VelocityEnv:
    """The environment of one robot and one configuration; holds constants only."""

    def __init__(self, robot: Robot, config: EnvConfig) -> None:
        unknown = set(config.rewards) - set(REWARD_TERMS)
        if unknown:
            raise UserError(f"no reward '{min(unknown)}': there are {', '.join(REWARD_TERMS)}")
        if config.physics not in PHYSICS:
            raise UserError(f"no physics '{config.physics}': there are {', '.join(PHYSICS)}")
        self.robot = robot
        self.config = config
        self.contract = make_contract(robot, config)
        self.period_s = 1.0 / config.control_rate_hz
        self.timestep_s = config.timestep_s
        self._check_delays()
        model = training_model(robot, self.timestep_s)
        self._physics = PHYSICS[config.physics](model, robot)
        self._nominal = SimpleNamespace(
            **{
                name: jnp.asarray(getattr(model, name), dtype=jnp.float32)
                for name in randomised_field_names()
            }
        )
        self._bodies, self._dof_count = model.nbody - 1, model.nv
        self._map = body_map(model, robot)
        positions, dofs = joint_addresses(model, robot)
        self._positions, self._dofs = jnp.asarray(positions), jnp.asarray(dofs)
        feet = [model.geom(foot.geom).id for foot in robot.description.feet]
        self._foot_radius = jnp.asarray(model.geom_size[feet, 0], dtype=jnp.float32)
        self._foot_friction = float(ground_friction(model, robot).mean())
        self._foot_phase = jnp.asarray([f.phase for f in robot.description.feet], dtype=jnp.float32)
        self._motor = Motor(*(jnp.asarray(a, dtype=jnp.float32) for a in robot.motor))
        lower, upper = robot.soft_limits
        self._soft = jnp.asarray(lower, dtype=jnp.float32), jnp.asarray(upper, dtype=jnp.float32)
        self._default = jnp.asarray(robot.default_pose, dtype=jnp.float32)
        self._kp = jnp.asarray(robot.kp, dtype=jnp.float32)
        self._kd = jnp.asarray(robot.kd, dtype=jnp.float32)
        self._qpos0 = np.array(model.qpos0, dtype=np.float32)
        self._qpos0[positions] = robot.default_pose
        self._qpos0[2] = robot.description.standing_height_m
        self.action_size = len(robot.joint_names)
        self.episode_steps = round(config.episode_s * config.control_rate_hz)

    @property
    def observation_sizes(self) -> dict[str, int]:
        """Size of the actor's and the critic's observation."""
        shapes = jax.eval_shape(lambda key: self.reset(key)[1], jax.random.key(0))
        return {name: leaf.shape[-1] for name, leaf in shapes.items()}

    def level(self, steps: jax.Array) -> jax.Array:
        """The curriculum's level after so many environment steps in all, 0 to 1."""
        ramp = self.config.curriculum.steps
        return jnp.ones_like(steps) if ramp == 0 else jnp.minimum(steps / ramp, 1.0)

    def at_level(self, state: State, level: jax.Array) -> State:
        """The same batch of episodes at another level of the curriculum."""
        return state._replace(level=jnp.full_like(state.level, level))

    def reset(self, key: jax.Array, level: jax.Array | float = 1.0) -> tuple[State, dict[str, jax.Array]]:
        """A new episode: state, command, timers, delay buffers and body are all drawn afresh."""
        config, n = self.config, self.action_size
        key, sample_key, rest_key = jax.random.split(key, 3)
        pose, noise, command, timers, clock = _uniform(
            rest_key, 7 + 2 * n, readings_size(n), COMMAND_NUMBERS, 2, 1
        )
        sample = draw(config.randomisation, lambda k: jax.random.uniform(sample_key, (k,)), n, self._bodies)
        sample = towards_nominal(sample, _grown(config.curriculum.randomisation, level), self._foot_friction)
        qpos, qvel = self._initial_state(pose)
        reading = self._reading(qpos, qvel)
        state = State(
            key=key,
            level=jnp.asarray(level, dtype=jnp.float32),
            qpos=qpos,
            qvel=qvel,
            qacc_warmstart=jnp.zeros_like(qvel),
            sample=sample,
            fields=randomised_fields(self._nominal, sample, self._map),
            command=self._draw_command(command, level),
            hold_steps=draw_hold_steps(timers[0], config.commands, config.control_rate_hz),
            push_steps=self._draw_push_steps(timers[1]),
            steps=jnp.int32(0),
            phase=clock,
            actions=jnp.zeros((3, n)),
            goals=jnp.tile(self._default, (KEPT_GOALS, 1)),
            target=self._default,
            trail=jnp.tile(reading, (config.substeps, 1)),
            frames=jnp.zeros((history_length(self.contract), frame_size(self.contract))),
        )
        state, observed = self._observe(state, jnp.tile(reading, (2 * config.substeps, 1)), noise, fill=True)
        feet = jnp.zeros(len(self._foot_phase))
        return state, self._observations(state, observed, feet, feet, jnp.zeros(n))

    def step(self, state: State, action: jax.Array) -> tuple[State, Step]:
        """One control step: delayed targets through the joint law and the physics, then a new observation."""
        config = self.config
        goal = joint_target(action, state.phase, state.command, self.contract)
        state = state._replace(
            actions=jnp.concatenate([action[None], state.actions[:-1]]),
            goals=jnp.concatenate([goal[None], state.goals[:-1]]),
        )
        state, passed = self._simulate(state)
        diverged = ~(jnp.all(jnp.isfinite(state.qpos)) & jnp.all(jnp.abs(state.qvel) < config.speed_limit))
        steps = state.steps + 1
        gait = config.gait.frequency_hz if config.gait else 0.0
        state = state._replace(steps=steps, phase=(state.phase + gait * self.period_s) % 1.0)

        outcome = self._outcome(state, passed)
        terminated = jnp.maximum(outcome.fell, diverged.astype(jnp.float32))
        terms = rewards(outcome, config.rewards, config.reward_scales)
        rate = reward_rate(terms, config.reward_scales)
        reward = jnp.where(diverged, config.rewards.get("fall", 0.0), rate) * self.period_s

        readings = jax.vmap(self._reading)(passed.qpos, passed.qvel)
        trail = jnp.concatenate([state.trail, readings])
        key, numbers_key = jax.random.split(state.key)
        disturbance, noise = _uniform(numbers_key, DISTURBANCE_NUMBERS, readings_size(self.action_size))
        state = self._disturb(state._replace(key=key, trail=readings), disturbance)
        state, observed = self._observe(state, trail, noise)
        feet = (outcome.contact, outcome.clearance)
        observations = self._observations(state, observed, *feet, outcome.torque)
        truncated = (steps >= self.episode_steps).astype(jnp.float32) * (1.0 - terminated)
        error = outcome.command - jnp.concatenate([outcome.linear_velocity[:2], outcome.angular_velocity[2:]])
        metrics = {f"reward/{name}": value for name, value in terms.items()} | {
            "tracking/linear_error_m_s": jnp.sqrt(jnp.sum(error[:2] ** 2)),
            "tracking/yaw_error_rad_s": jnp.abs(error[2]),
            "episode/falls": outcome.fell,
        }
        observations, metrics = jax.tree.map(lambda x: jnp.where(diverged, 0.0, x), (observations, metrics))
        metrics["episode/diverged"] = diverged.astype(jnp.float32)
        return state, Step(observations, reward, terminated, truncated, metrics)

    def _simulate(self, state: State) -> tuple[State, Trace]:
        """Physics of one control step; returns what each physics step left, stacked."""
        targets = self._targets(state)
        zeros = jnp.zeros_like(self._kp)
        command = randomised_command(JointCommand(targets, zeros, self._kp, self._kd, zeros), state.sample)
        motor = randomised_motor(self._motor, state.sample)
        bias = sensor_bias(state.sample, "joint_position")
        drive = Drive(targets, command.kp, command.kd, motor, zeros if bias is None else bias)
        start = Motion(state.qpos, state.qvel, state.qacc_warmstart)
        end, passed = self._physics(start, drive, state.fields)
        return state._replace(**end._asdict(), target=targets[-1]), passed

    def _targets(self, state: State) -> jax.Array:
        """The target at each physics step, rad, shape (substeps, n): delayed, then rate-limited."""
        lower, upper = self._soft
        rate = self.robot.description.target_rate_rad_s

        def tick(target: jax.Array, goal: jax.Array) -> tuple[jax.Array, jax.Array]:
            target = limit_target(goal, target, lower, upper, rate, self.timestep_s)
            return target, target

        starts_s = np.arange(self.config.substeps) * self.timestep_s
        delay_s = state.sample.get("action_delay_s")
        goals = delayed_goals(state.goals, delay_s, starts_s, self.timestep_s, self.period_s)
        return jax.lax.scan(tick, state.target, goals, unroll=True)[1]

    def _outcome(self, state: State, passed: Trace) -> Outcome:
        config = self.config
        quaternion = state.qpos[3:7]
        foot = passed.foot_position
        clearance = foot[-1, :, 2] - self._foot_radius
        foot_velocity = (foot[-1] - foot[-2]) / self.timestep_s
        gravity = projected_gravity(quaternion)
        height = state.qpos[2]
        fell = (gravity[2] > -np.cos(config.tilt_limit_rad)) | (
            height < config.least_height_share * self.robot.description.standing_height_m
        )
        walk = moving(state.command, self.contract)[0]
        planned = jnp.sin(2 * jnp.pi * (state.phase + self._foot_phase))
        return Outcome(
            command=state.command,
            moving=walk,
            linear_velocity=rotate_to_body(quaternion, state.qvel[:3]),
            angular_velocity=state.qvel[3:6],
            gravity=gravity,
            height=height,
            standing_height=self.robot.description.standing_height_m,
            joint_position=state.qpos[self._positions],
            joint_velocity=state.qvel[self._dofs],
            default_pose=self._default,
            soft_lower=self._soft[0],
            soft_upper=self._soft[1],
            torque=passed.torque[-1],
            actions=state.actions,
            contact=(clearance < CONTACT_CLEARANCE_M).astype(jnp.float32),
            clearance=clearance,
            foot_speed=jnp.sqrt(jnp.sum(foot_velocity[:, :2] ** 2, axis=-1)),
            swing=jnp.maximum(planned, 0.0) * walk,
            fell=fell.astype(jnp.float32),
        )

    def _observe(
        self, state: State, trail: jax.Array, u: jax.Array, fill: bool = False
    ) -> tuple[State, jax.Array]:
        """Push a frame of delayed, biased, noisy readings; with `fill`, it becomes the whole history.

        Args:
            u: uniform numbers, shape (readings_size,).
        """
        delayed = delayed_readings(trail, state.sample.get("observation_delay_s"), self.timestep_s)
        readings = biased(from_vector(delayed, self.action_size), state.sample)
        readings = noisy(readings, self.config.noise, u)
        newest = frame(Inputs(readings, state.actions[0], state.command, state.phase), self.contract)
        frames = jnp.broadcast_to(newest, state.frames.shape) if fill else push_frame(state.frames, newest)
        return state._replace(frames=frames), observation(frames, self.contract)

    def _observations(
        self,
        state: State,
        observed: jax.Array,
        contact: jax.Array,
        clearance: jax.Array,
        torque: jax.Array,
    ) -> dict[str, jax.Array]:
        """The actor's observation, and the critic's: clean readings and what no robot senses."""
        readings = from_vector(self._reading(state.qpos, state.qvel), self.action_size)
        clean = frame(Inputs(readings, state.actions[0], state.command, state.phase), self.contract)
        truth = Truth(
            linear_velocity=rotate_to_body(state.qpos[3:7], state.qvel[:3]),
            height=state.qpos[2],
            contact=contact,
            clearance=clearance,
            torque=torque / self._motor.peak_torque,
        )
        privileged = critic_observation(observed, clean, truth, state.sample)
        return {"state": observed, "privileged_state": privileged}

    def _disturb(self, state: State, u: jax.Array) -> State:
        """Draw a new command when the old one's time is up, and push when a push is due.

        Args:
            u: uniform numbers, shape (DISTURBANCE_NUMBERS,).
        """
        config = self.config
        command, push, (hold, interval) = _parts(u, COMMAND_NUMBERS, PUSH_NUMBERS, 2)
        command_due, push_due = state.hold_steps <= 0, state.push_steps <= 0
        hold_steps = draw_hold_steps(hold, config.commands, config.control_rate_hz)
        strength = _grown(config.curriculum.pushes, state.level)
        kick = jnp.where(push_due, strength * self._draw_push(push), 0.0)
        return state._replace(
            command=jnp.where(command_due, self._draw_command(command, state.level), state.command),
            hold_steps=jnp.where(command_due, hold_steps, state.hold_steps - 1),
            push_steps=jnp.where(push_due, self._draw_push_steps(interval), state.push_steps - 1),
            qvel=state.qvel.at[:6].add(kick),
        )

    def _draw_command(self, u: jax.Array, level: jax.Array | float) -> jax.Array:
        return draw_command(u, self.config.commands) * _grown(self.config.curriculum.commands, level)

    def _draw_push_steps(self, u: jax.Array) -> jax.Array:
        seconds = self.config.pushes.interval_s.quantile(u)
        return jnp.int32(seconds * self.config.control_rate_hz)

    def _draw_push(self, u: jax.Array) -> jax.Array:
        """Change of the free joint's velocity, shape (6,): linear in the world, angular in the body.

        Args:
            u: uniform numbers, shape (PUSH_NUMBERS,).
        """
        pushes = self.config.pushes
        angle, size = 2 * jnp.pi * u[0], pushes.horizontal_m_s * u[1]
        linear = jnp.array(
            [size * jnp.cos(angle), size * jnp.sin(angle), pushes.vertical_m_s * (2 * u[2] - 1)]
        )
        return jnp.concatenate([linear, pushes.angular_rad_s * (2 * u[3:] - 1)])

    def _initial_state(self, u: jax.Array) -> tuple[jax.Array, jax.Array]:
        start, n = self.config.initial, self.action_size
        u = 2 * u - 1
        yaw = jnp.pi * u[0]
        tilt = start.tilt_rad * u[1:3]
        quaternion = multiply(
            jnp.array([jnp.cos(yaw / 2), 0.0, 0.0, jnp.sin(yaw / 2)]),
            normalised(jnp.array([1.0, tilt[0] / 2, tilt[1] / 2, 0.0])),
        )
        # Joints differ, and XLA is told so: what might add twice would be added one by one on a GPU.
        qpos = jnp.asarray(self._qpos0)
        qpos = qpos.at[3:7].set(quaternion)
        qpos = qpos.at[self._positions].add(start.joint_rad * u[7 : 7 + n], unique_indices=True)
        qvel = jnp.zeros(self._dof_count)
        qvel = qvel.at[:2].set(start.velocity_m_s * u[3:5])
        qvel = qvel.at[5].set(start.yaw_rate_rad_s * u[5])
        return qpos, qvel.at[self._dofs].set(start.joint_velocity_rad_s * u[7 + n :], unique_indices=True)

    def _reading(self, qpos: jax.Array, qvel: jax.Array) -> jax.Array:
        """True readings as one vector."""
        sensed = Sensed(
            gyro=qvel[3:6],
            acceleration=None,
            quaternion=qpos[3:7],
            joint_position=qpos[self._positions],
            joint_velocity=qvel[self._dofs],
            joint_torque=None,
        )
        return as_vector(read(sensed))

    def _check_delays(self) -> None:
        longest: dict[str, tuple[Any, float]] = {
            "action_delay_s": (self.config.randomisation.action_delay_s, (KEPT_GOALS - 1) * self.period_s),
            "observation_delay_s": (self.config.randomisation.observation_delay_s, self.period_s),
        }
        for name, (distribution, limit) in longest.items():
            if distribution is not None and not 0 <= distribution.low <= distribution.high <= limit:
                raise UserError(f"randomisation.{name}: must lie between 0 and {limit} s")


def _uniform(key: jax.Array, *sizes: int) -> list[jax.Array]:
    """Independent numbers in [0, 1), in vectors of these sizes. One large draw costs less than many."""
    return _parts(jax.random.uniform(key, (sum(sizes),)), *sizes)


def _parts(vector: jax.Array, *sizes: int) -> list[jax.Array]:
    return jnp.split(vector, np.cumsum(sizes)[:-1])


def _grown(start: float, level: jax.Array | float) -> jax.Array | float:
    """What grows linearly from `start` at the curriculum's level 0 to 1 at level 1."""
    return start + (1 - start) * level

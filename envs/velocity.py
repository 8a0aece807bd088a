"""Velocity tracking on flat ground: a functional environment.

`reset(key)` and `step(state, action)` are pure and concern one robot; `jax.vmap` makes them many.
"""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.domain_rand.bodies import body_map, randomised_field_names, randomised_fields
from footfall.domain_rand.sample import Sample, draw, towards_nominal
from footfall.envs.actuation import KEPT_GOALS, Actuation
from footfall.envs.base import Base
from footfall.envs.commands import COMMAND_NUMBERS, draw_hold_steps
from footfall.envs.config import EnvConfig
from footfall.envs.critic import Truth, actor_kinds, critic_kinds, critic_observation
from footfall.envs.curriculum import level_after, share
from footfall.envs.disturb import DISTURBANCE_NUMBERS, command_at_level, disturb, draw_push_steps
from footfall.envs.feet import Feet
from footfall.envs.gait import make_gait
from footfall.envs.ground import height_above_ground, in_contact
from footfall.envs.observe import Observer
from footfall.envs.physics.engines import ENGINES, make_engine
from footfall.envs.physics.interface import Motion, Trace
from footfall.envs.random_numbers import uniform
from footfall.envs.rewards import TERMS as REWARD_TERMS
from footfall.envs.rewards import RewardInputs, joint_shares, reward_rate, rewards
from footfall.envs.start import Start
from footfall.envs.state import State, Step
from footfall.envs.symmetry import EnvironmentMirror, environment_mirror
from footfall.policies.action import joint_target
from footfall.policies.contract import Contract
from footfall.policies.gaits import find_gait
from footfall.policies.observation import moving
from footfall.robots.description import Robot
from footfall.robots.kinds import Parts
from footfall.robots.model import ground_friction, joint_addresses, training_model
from footfall.robots.stability import longest_timestep


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
        """Raises UserError if the configuration names what there is not, too long delays or steps."""
        unknown = set(config.rewards) - set(REWARD_TERMS)
        if unknown:
            raise UserError(f"no reward '{min(unknown)}': there are {', '.join(REWARD_TERMS)}")
        if config.physics not in ENGINES:
            raise UserError(f"no physics '{config.physics}': there are {', '.join(ENGINES)}")
        self.robot, self.config = robot, config
        self.contract = make_contract(robot, config)
        self.period_s, self.timestep_s = 1.0 / config.control_rate_hz, config.timestep_s
        self.action_size = len(robot.joint_names)
        self.episode_steps = round(config.episode_s * config.control_rate_hz)
        model = training_model(robot, self.timestep_s)
        _check_timestep(robot, model, config)
        self.engine = make_engine(config.physics, model, robot)
        gait = find_gait(config.gait.name, robot) if config.gait else None
        self.base, self.feet = Base(model, robot), Feet(model, robot, self.timestep_s, gait)
        self.start, self.actuation = Start(model, robot, config.initial), Actuation(robot, config)
        self.observer = Observer(model, robot, config, self.contract)
        self._positions, self._dofs = map(jnp.asarray, joint_addresses(model, robot))
        shares = joint_shares(robot.joint_names, config.reward_scales.pose_shares)
        self._pose_share = jnp.asarray(shares, dtype=jnp.float32)
        self._default = jnp.asarray(robot.default_pose, dtype=jnp.float32)
        self._bodies, self._map = model.nbody - 1, body_map(model, robot)
        self._friction = float(ground_friction(model, robot).mean())
        fields = {name: getattr(model, name) for name in randomised_field_names()}
        self._nominal = SimpleNamespace(
            **{name: jnp.asarray(value, dtype=jnp.float32) for name, value in fields.items()}
        )

    @property
    def on_host(self) -> bool:
        """Whether physics runs on the host's processor."""
        return self.engine.on_host

    @property
    def note(self) -> str:
        """Why another physics engine runs than the configuration asks for; empty if it does not."""
        return self.engine.note

    def mirror(self) -> EnvironmentMirror:
        """Mirror images of observations and actions; raises UserError if there are none."""
        return environment_mirror(self.robot, self.config, self.contract)

    @property
    def observation_sizes(self) -> dict[str, int]:
        """Size of the actor's and the critic's observation."""
        parts = Parts(self.action_size, self._bodies, self.feet.count)
        critic = critic_kinds(self.contract, self.config.randomisation)
        kinds = {"state": actor_kinds(self.contract), "privileged_state": critic}
        return {name: sum(kind.size(parts) for kind in each) for name, each in kinds.items()}

    def level(self, steps: jax.Array) -> jax.Array:
        """The curriculum's level after so many environment steps in all, 0 to 1."""
        return level_after(steps, self.config.curriculum)

    def at_level(self, state: State, level: jax.Array) -> State:
        """The same batch of episodes at another level of the curriculum."""
        return state._replace(level=jnp.full_like(state.level, level))

    def reset(self, key: jax.Array, level: jax.Array | float = 1.0) -> tuple[State, dict[str, jax.Array]]:
        """A new episode: state, command, timers, delay buffers and body are all drawn afresh."""
        config, n, substeps = self.config, self.action_size, self.config.substeps
        key, sample_key, rest_key = jax.random.split(key, 3)
        pose, noise, command, (hold, interval), clock = uniform(
            rest_key, self.start.numbers, self.observer.numbers, COMMAND_NUMBERS, 2, 1
        )
        sample = self._draw_robot(sample_key, level)
        qpos, qvel = self.start.draw(pose)
        torque = jnp.zeros(n)
        readings = self.observer.readings(qpos, qvel, torque)
        state = State(
            key=key,
            level=jnp.asarray(level, dtype=jnp.float32),
            qpos=qpos,
            qvel=qvel,
            qacc_warmstart=jnp.zeros_like(qvel),
            sample=sample,
            fields=randomised_fields(self._nominal, sample, self._map),
            command=command_at_level(command, config, level),
            hold_steps=draw_hold_steps(hold, config.commands, config.control_rate_hz),
            push_steps=draw_push_steps(interval, config),
            steps=jnp.int32(0),
            phase=clock,
            actions=jnp.zeros((3, n)),
            goals=jnp.tile(self._default, (KEPT_GOALS, 1)),
            target=self._default,
            recent_readings=jnp.tile(readings, (substeps, 1)),
            frames=self.observer.no_frames(),
        )
        state, observed = self.observer.observe(
            state, jnp.tile(readings, (2 * substeps, 1)), noise, first=True
        )
        feet = jnp.zeros(self.feet.count)
        return state, self.observations(state, observed, contact=feet, clearance=feet, torque=torque)

    def step(self, state: State, action: jax.Array) -> tuple[State, Step]:
        """One control step: delayed targets through the joint law and the physics, then a new observation."""
        config = self.config
        goal = joint_target(action, state.phase, state.command, self.contract)
        state = state._replace(
            actions=jnp.concatenate([action[None], state.actions[:-1]]),
            goals=jnp.concatenate([goal[None], state.goals[:-1]]),
        )
        state, trace = self.simulate(state)
        diverged = ~(jnp.all(jnp.isfinite(state.qpos)) & jnp.all(jnp.abs(state.qvel) < config.speed_limit))
        frequency_hz = config.gait.frequency_hz if config.gait else 0.0
        phase = (state.phase + frequency_hz * self.period_s) % 1.0
        state = state._replace(steps=state.steps + 1, phase=phase)

        inputs = self.reward_inputs(state, trace)
        terms = rewards(inputs, config.rewards, config.reward_scales)
        rate = reward_rate(terms, config.reward_scales)
        reward = jnp.where(diverged, config.rewards.get("fall", 0.0), rate) * self.period_s
        terminated = jnp.maximum(inputs.fell, diverged.astype(jnp.float32))
        truncated = (state.steps >= self.episode_steps).astype(jnp.float32) * (1.0 - terminated)

        readings = jax.vmap(self.observer.readings)(trace.qpos, trace.qvel, trace.torque)
        recent = jnp.concatenate([state.recent_readings, readings])
        key, numbers_key = jax.random.split(state.key)
        disturbance, noise = uniform(numbers_key, DISTURBANCE_NUMBERS, self.observer.numbers)
        state = state._replace(key=key, recent_readings=readings)
        state = disturb(state, disturbance, config, self.base)
        state, observed = self.observer.observe(state, recent, noise)
        observations = self.observations(state, observed, inputs.contact, inputs.clearance, inputs.torque)

        metrics = {f"reward/{name}": value for name, value in terms.items()} | tracking_metrics(inputs)
        observations, metrics = jax.tree.map(lambda x: jnp.where(diverged, 0.0, x), (observations, metrics))
        metrics["episode/diverged"] = diverged.astype(jnp.float32)
        return state, Step(observations, reward, terminated, truncated, metrics)

    def simulate(self, state: State) -> tuple[State, Trace]:
        """Physics of one control step; returns what each physics step left, stacked."""
        targets = self.actuation.targets(state.goals, state.target, state.sample)
        start = Motion(state.qpos, state.qvel, state.qacc_warmstart)
        end, trace = self.engine.simulate(start, self.actuation.drive(targets, state.sample), state.fields)
        return state._replace(**end._asdict(), target=targets[-1]), trace

    def reward_inputs(self, state: State, trace: Trace) -> RewardInputs:
        """What the rewards judge, of a state after the physics and what its physics steps left."""
        config, standing_height = self.config, self.robot.description.standing_height_m
        gravity = self.base.gravity(state.qpos)
        height = height_above_ground(self.base.position(state.qpos))
        tilted = gravity[2] > -np.cos(config.tilt_limit_rad)
        sunk = height < config.least_height_share * standing_height
        walk = moving(state.command, self.contract)[0]
        clearance = self.feet.clearance(trace.foot_position[-1])
        return RewardInputs(
            command=state.command,
            moving=walk,
            linear_velocity=self.base.linear_velocity(state.qpos, state.qvel),
            angular_velocity=self.base.angular_velocity(state.qvel),
            gravity=gravity,
            height=height,
            standing_height=standing_height,
            joint_position=state.qpos[self._positions],
            joint_velocity=state.qvel[self._dofs],
            default_pose=self._default,
            pose_share=self._pose_share,
            soft_lower=self.actuation.soft_lower,
            soft_upper=self.actuation.soft_upper,
            torque=trace.torque[-1],
            actions=state.actions,
            contact=in_contact(clearance),
            clearance=clearance,
            foot_speed=self.feet.speed(trace.foot_position),
            crowding=self.feet.crowding(trace.foot_position[-1], config.reward_scales.foot_distance_m),
            foot_tilt=self.feet.tilt(trace.foot_position[-1]),
            swing=self.feet.planned_swing(state.phase, walk),
            fell=(tilted | sunk).astype(jnp.float32),
        )

    def observations(
        self,
        state: State,
        observed: jax.Array,
        contact: jax.Array,
        clearance: jax.Array,
        torque: jax.Array,
    ) -> dict[str, jax.Array]:
        """The actor's observation, and the critic's, which is told of feet (feet,) and torques (n,) too."""
        truth = Truth(
            linear_velocity=self.base.linear_velocity(state.qpos, state.qvel),
            height=height_above_ground(self.base.position(state.qpos)),
            contact=contact,
            clearance=clearance,
            torque=torque / self.actuation.peak_torque,
        )
        clean = self.observer.clean_frame(state, torque)
        privileged = critic_observation(observed, clean, truth, state.sample)
        return {"state": observed, "privileged_state": privileged}

    def _draw_robot(self, key: jax.Array, level: jax.Array | float) -> Sample:
        """How this episode's robot differs from the nominal one."""
        randomisation = self.config.randomisation
        sample = draw(randomisation, lambda k: jax.random.uniform(key, (k,)), self.action_size, self._bodies)
        return towards_nominal(sample, share(self.config.curriculum.randomisation, level), self._friction)


def _check_timestep(robot: Robot, model: mujoco.MjModel, config: EnvConfig) -> None:
    """Raise UserError if the physics steps are too long for the robot's joints."""
    longest_s, joint = longest_timestep(robot.description, model, robot.kp)
    if config.timestep_s > longest_s:
        raise UserError(
            f"control_rate_hz {config.control_rate_hz:g} with {config.substeps} substeps makes steps of"
            f" {1e3 * config.timestep_s:.3g} ms: joint {joint} of {robot.name} is too stiff for steps beyond"
            f" {1e3 * longest_s:.3g} ms"
        )


def tracking_metrics(inputs: RewardInputs) -> dict[str, jax.Array]:
    """How far the robot is from its command, and whether it fell."""
    velocity = jnp.concatenate([inputs.linear_velocity[:2], inputs.angular_velocity[2:]])
    error = inputs.command - velocity
    return {
        "tracking/linear_error_m_s": jnp.sqrt(jnp.sum(error[:2] ** 2)),
        "tracking/yaw_error_rad_s": jnp.abs(error[2]),
        "episode/falls": inputs.fell,
    }

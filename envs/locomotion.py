"""The environment that steps a task's terms around the physics: a functional environment.

`reset(key)` and `step(state, action)` are pure functions for one robot; `jax.vmap` batches them.
"""

import functools
from types import SimpleNamespace

import jax
import jax.numpy as jnp

from footfall.common.arrays import single
from footfall.common.errors import UserError
from footfall.domain_rand.bodies import body_map, randomised_field_names, randomised_fields
from footfall.domain_rand.randomisation import QUANTITIES
from footfall.domain_rand.sample import Sample, draw, towards_nominal
from footfall.envs.actuation import KEPT_GOALS, Actuation
from footfall.envs.checks import check_events, check_timestep
from footfall.envs.config import EnvConfig
from footfall.envs.contract import make_contract
from footfall.envs.disturb import Disturbances
from footfall.envs.feet import Feet
from footfall.envs.lateness import Lateness
from footfall.envs.limp import countdown, stiffness, while_limp
from footfall.envs.metrics import tracking_metrics
from footfall.envs.observe import Observer
from footfall.envs.physics.engines import ENGINES, make_engine
from footfall.envs.physics.interface import GRAVITY, Motion, Trace
from footfall.envs.random_numbers import uniform
from footfall.envs.state import State, Step
from footfall.envs.supply import Supply
from footfall.envs.symmetry import EnvironmentMirror, environment_mirror
from footfall.envs.task import Task
from footfall.envs.terms.data import Scene, StepData, example_data
from footfall.envs.terrain import make_terrain
from footfall.policies.action import joint_target
from footfall.policies.gaits import find_gait
from footfall.policies.observation import moving, term_kind
from footfall.robots.description import Robot
from footfall.robots.kinds import Kind, Parts
from footfall.robots.model import ground_friction, training_model


class LocomotionEnv:
    """The environment of one robot and one configuration; holds constants only."""

    def __init__(self, robot: Robot, config: EnvConfig) -> None:
        """Raises UserError if the configuration names unknown things, or delays or steps are too long."""
        if config.physics not in ENGINES:
            raise UserError(f"no physics '{config.physics}': there are {', '.join(ENGINES)}")
        self.robot, self.config = robot, config
        self.contract = make_contract(robot, config)
        self.period_s, self.timestep_s = 1.0 / config.control_rate_hz, config.timestep_s
        self.action_size = len(robot.joint_names)
        self.episode_steps = round(config.episode_s * config.control_rate_hz)
        exact_friction = config.terrain is not None and config.terrain.exact_friction
        model = training_model(robot, self.timestep_s, config.contacts, exact_friction)
        check_timestep(robot, model, config)
        self.engine = make_engine(config.physics, model, robot)
        gait = find_gait(config.gait.name, robot) if config.gait else None
        self.scene = Scene(model, robot, Feet(model, robot, self.timestep_s, gait), self.period_s)
        self.terrain = make_terrain(config, self.engine, model, self.scene)
        self.task = Task(config, self.scene)
        check_events(self.task, self.engine)
        self.actuation = Actuation(robot, config)
        self.lateness = Lateness(self.action_size, self.period_s)
        self.supply = Supply(robot, config.randomisation)
        self.observer = Observer(model, robot, config, self.contract)
        self.disturbances = Disturbances(self.task, config, self.scene)
        self._map = body_map(model, robot)
        self._friction = float(ground_friction(model, robot).mean())
        self._nominal = {name: single(getattr(model, name)) for name in randomised_field_names()}

    @property
    def on_host(self) -> bool:
        """Whether physics runs on the host's processor."""
        return self.engine.on_host

    @property
    def note(self) -> str:
        """Why another physics engine runs than the configured one; empty if the configured one runs."""
        return self.engine.note

    def mirror(self) -> EnvironmentMirror:
        """Mirror images of observations and actions; raises UserError if there are none."""
        gait = self.config.gait.name if self.config.gait else None
        return environment_mirror(self.robot, gait, self.layout)

    @property
    def layout(self) -> dict[str, list[Kind]]:
        """The kinds of numbers that are concatenated in the actor's and in the critic's observation."""
        terms = self.contract.observation
        actor = [term_kind(term) for term in terms for _ in range(term.history)]
        newest = [term_kind(term) for term in terms]
        randomisation = self.config.randomisation
        sampled = [q.kind for name, q in QUANTITIES.items() if getattr(randomisation, name) is not None]
        return {"state": actor, "privileged_state": [*actor, *newest, *self.task.critic_kinds, *sampled]}

    @property
    def observation_sizes(self) -> dict[str, int]:
        """Size of the actor's and the critic's observation."""
        parts = Parts(self.action_size, self.scene.bodies, self.scene.feet.count)
        return {name: sum(kind.size(parts) for kind in kinds) for name, kinds in self.layout.items()}

    def level(self, steps: jax.Array) -> jax.Array:
        """The curriculum's level, 0 to 1, after `steps` environment steps of the whole training."""
        ramp = self.config.curriculum_steps
        return jnp.ones_like(steps) if ramp == 0 else jnp.minimum(steps / ramp, 1.0)

    def at_level(self, state: State, level: jax.Array) -> State:
        """The same batch of episodes at another level of the curriculum."""
        return state._replace(level=jnp.full_like(state.level, level))

    def reset(self, key: jax.Array, level: jax.Array | float = 1.0) -> tuple[State, dict[str, jax.Array]]:
        """A new episode, with all of its state newly drawn."""
        return self._begin(key, level, None)

    def restart(self, state: State) -> tuple[State, dict[str, jax.Array]]:
        """The episode after the one that ended in this state."""
        return self._begin(state.key, state.level, state)

    def _begin(
        self, key: jax.Array, level: jax.Array | float, previous: State | None
    ) -> tuple[State, dict[str, jax.Array]]:
        n, substeps, events = self.action_size, self.config.substeps, self.disturbances
        key, sample_key, rest_key = jax.random.split(key, 3)
        noise_size, command_size = self.observer.numbers, self.task.command.numbers
        *u_resets, u_noise, u_command, (u_hold, *u_intervals), phase = uniform(
            rest_key, *events.reset_numbers, noise_size, command_size, events.timer_count, 1
        )
        sample = self._draw_robot(sample_key, level)
        nominal = SimpleNamespace(**jax.tree.map(jnp.asarray, self._nominal))
        qpos, qvel, torque = jnp.asarray(self.scene.standing), jnp.zeros(self.scene.nv), jnp.zeros(n)
        state = State(
            key=key,
            level=jnp.asarray(level, dtype=jnp.float32),
            qpos=qpos,
            qvel=qvel,
            qacc_warmstart=jnp.zeros_like(qvel),
            sample=sample,
            fields=randomised_fields(nominal, sample, self._map),
            command=events.command(u_command, level),
            hold_steps=events.hold_steps(u_hold),
            event_steps=events.event_steps(u_intervals),
            steps=jnp.int32(0),
            phase=phase,
            actions=jnp.zeros((3, n)),
            goals=jnp.tile(self.scene.default_pose, (KEPT_GOALS, 1)),
            target=jnp.asarray(self.scene.default_pose),
            recent_readings=jnp.zeros((substeps, self.observer.numbers)),
            history=self.observer.empty_history(),
            terms={},
            lagged_torque=self.actuation.initial_torque(sample),
            net_memory=self.actuation.initial_memory,
            winding_c=self.actuation.initial_winding_c(sample),
            lateness_s=self.lateness.initial(sample),
            supply=self.supply.at_rest(sample),
        )
        state = self.terrain.begin(events.reset(state, u_resets), jax.random.fold_in(rest_key, 1), previous)
        readings = self.observer.readings(state.qpos, state.qvel, torque, state.fields.get(GRAVITY))
        state = state._replace(recent_readings=jnp.tile(readings, (substeps, 1)))
        data = self.data_at(state, example_data(self.scene))
        recent = jnp.tile(readings, (2 * substeps, 1))
        state, observed = self.observer.observe(state, recent, u_noise, data.ground, is_reset=True)
        state = state._replace(terms=state.terms | self.task.init(data))
        return self.observations(state, observed, data)

    def step(self, state: State, action: jax.Array) -> tuple[State, Step]:
        """One control step: delayed targets through the joint law and the physics, then a new observation."""
        config, task = self.config, self.task
        goal = joint_target(action, state.phase, state.command, self.contract)
        action, goal = while_limp(state, action, goal, state.qpos[self.scene.positions])
        state = state._replace(
            actions=jnp.concatenate([action[None], state.actions[:-1]]),
            goals=jnp.concatenate([goal[None], state.goals[:-1]]),
            lateness_s=self.lateness.of_goals(state),
        )
        state, trace = self.simulate(state)
        diverged = ~(jnp.all(jnp.isfinite(state.qpos)) & jnp.all(jnp.abs(state.qvel) < config.speed_limit))
        frequency_hz = config.gait.frequency_hz if config.gait else 0.0
        phase = (state.phase + frequency_hz * self.period_s) % 1.0
        state = countdown(state)._replace(steps=state.steps + 1, phase=phase)

        state = self.terrain.after_physics(state, trace)
        state, data, values = self._evaluate(state, self.step_data(state, trace))
        state = self.terrain.after_step(state, data)
        diverged_rate = sum(task.weights[name] for name in task.in_full)
        reward = jnp.where(diverged, diverged_rate, self._reward_rate(values)) * self.period_s
        terminated = jnp.maximum(data.fell, diverged.astype(jnp.float32))
        truncated = (state.steps >= self.episode_steps).astype(jnp.float32) * (1.0 - terminated)

        readings_at = functools.partial(self.observer.readings, gravity=state.fields.get(GRAVITY))
        readings = jax.vmap(readings_at)(trace.qpos, trace.qvel, trace.torque)
        recent = jnp.concatenate([state.recent_readings, readings])
        key, numbers_key = jax.random.split(state.key)
        u_disturbances, u_noise = uniform(numbers_key, self.disturbances.step_numbers, self.observer.numbers)
        state = self.disturbances.step(state._replace(key=key, recent_readings=readings), u_disturbances)
        data_now = self.data_at(state, data)  # after events and a new command, which rewards do not see
        delay_s = self.lateness.of_readings(state, numbers_key)
        state, observed = self.observer.observe(state, recent, u_noise, data_now.ground, lateness_s=delay_s)
        state, observations = self.observations(state, observed, data_now)

        metrics = {f"reward/{name}": value for name, value in values.items()}
        metrics |= tracking_metrics(data) | self.terrain.metrics(state)
        observations, metrics = jax.tree.map(lambda x: jnp.where(diverged, 0.0, x), (observations, metrics))
        metrics["episode/diverged"] = diverged.astype(jnp.float32)
        return state, Step(observations, reward, terminated, truncated, metrics)

    def simulate(self, state: State) -> tuple[State, Trace]:
        """Physics of one control step; returns the state and the stacked records of the physics steps."""
        targets = self.actuation.targets(state.goals, state.target, state.sample, state.lateness_s)
        start = Motion(state.qpos, state.qvel, state.qacc_warmstart, state.lagged_torque, state.net_memory)
        drive = self.actuation.drive(targets, state.sample, state.supply, state.winding_c)
        drive = drive._replace(kp=stiffness(state, drive.kp))
        end, trace = self.engine.simulate(start, drive, state.fields | self.terrain.fields(state))
        velocities = jnp.concatenate([state.qvel[None], trace.qvel])[:, self.scene.dofs]
        supply = self.supply.under_load(state.sample, trace.torque, velocities)
        winding_c = self.actuation.next_winding_c(state.winding_c, trace.torque, state.sample)
        state = state._replace(**end._asdict(), target=targets[-1], supply=supply, winding_c=winding_c)
        return state, trace

    def step_data(self, state: State, trace: Trace) -> StepData:
        """Inputs of the terms, from a state after the physics and the trace of its physics steps."""
        data = example_data(self.scene)._replace(
            torque=trace.torque[-1],
            foot_position=trace.foot_position[-1],
            foot_speed=self.scene.feet.speed(trace.foot_position),
        )
        return self.data_at(state, self.terrain.with_feet(state, data))

    def data_at(self, state: State, data: StepData) -> StepData:
        """The data with all values that depend only on the state updated."""
        scene, is_moving = self.scene, moving(state.command, self.contract)[0]
        return self.terrain.with_base(state, data)._replace(
            command=state.command,
            moving=is_moving,
            qpos=state.qpos,
            linear_velocity=scene.base.linear_velocity(state.qpos, state.qvel),
            angular_velocity=scene.base.angular_velocity(state.qvel),
            gravity=scene.base.gravity(state.qpos),
            joint_position=state.qpos[scene.positions],
            joint_velocity=state.qvel[scene.dofs],
            actions=state.actions,
            swing=scene.feet.planned_swing(state.phase, is_moving),
        )

    def _evaluate(self, state: State, data: StepData) -> tuple[State, StepData, dict[str, jax.Array]]:
        """Evaluate terminations, then rewards: returns state, data with `fell`, and weighted rewards."""
        task, terms = self.task, state.terms
        ends, terminations = task.terminations.evaluate(terms["terminations"], data)
        fell = functools.reduce(jnp.logical_or, (value > 0 for value in ends.values()), jnp.bool(False))
        data = data._replace(fell=fell.astype(jnp.float32))
        values, rewards = task.rewards.evaluate(terms["rewards"], data)
        weighted = {name: task.weights[name] * value for name, value in values.items()}
        state = state._replace(terms=terms | {"terminations": terminations, "rewards": rewards})
        return state, data, weighted

    def _reward_rate(self, weighted: dict[str, jax.Array]) -> jax.Array:
        """Reward per second of the weighted terms.

        The sum is clipped from below, or an untrained policy would earn most by ending the episode. Rewards
        for the end itself, which happens once, are not clipped.
        """
        in_full = self.task.in_full
        to_clip = sum((value for name, value in weighted.items() if name not in in_full), jnp.float32(0.0))
        unclipped = sum(value for name, value in weighted.items() if name in in_full)
        return jnp.maximum(to_clip, self.config.reward_floor) + unclipped

    def observations(
        self, state: State, observed: jax.Array, data: StepData
    ) -> tuple[State, dict[str, jax.Array]]:
        """The state with the critic terms' states, and both observations; `observed` is the actor's."""
        values, critic = self.task.critic.evaluate(state.terms["critic"], data)
        clean = self.observer.clean_values(state, data.torque, data.ground)
        sampled = [state.sample[name] for name in QUANTITIES if name in state.sample]
        privileged = [observed, clean, *map(jnp.ravel, values.values()), *map(jnp.ravel, sampled)]
        state = state._replace(terms=state.terms | {"critic": critic})
        return state, {"state": observed, "privileged_state": jnp.concatenate(privileged)}

    def _draw_robot(self, key: jax.Array, level: jax.Array | float) -> Sample:
        """Draw the differences of this episode's robot from the nominal one."""
        randomisation = self.config.randomisation
        bodies = self.scene.bodies
        sample = draw(randomisation, lambda k: uniform(key, k)[0], self.action_size, bodies)
        return towards_nominal(sample, self.task.strength("randomisation", level), self._friction)

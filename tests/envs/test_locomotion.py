"""One control step with distinct numbers: the inputs and outputs of the physics, and their order.

The physics is a fake whose physics steps differ, so that a step is plain arithmetic.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from go1_smoke import MODEL, ROBOT, SMOKE, N
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import Randomisation, load_randomisation
from footfall.envs.batch import RESTARTS_PER_PASS, step_batch
from footfall.envs.config import CurriculumConfig, EventConfig, GaitConfig, ObservationConfig, RewardConfig
from footfall.envs.contract import make_contract
from footfall.envs.gait import make_gait
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.physics.interface import Drive, Fields, Motion, Trace
from footfall.envs.state import State, Step
from footfall.policies.action import joint_target
from footfall.policies.contract import CommandRange

SUBSTEPS = 4
TILTED = Rotation.from_euler("xyz", [0.3, -0.4, 2.0])
TORQUE = np.linspace(-3.0, 4.0, N)
TURN = np.array([0.3, -0.5, 0.7])  # rad/s more in each physics step

REWARDS = {"track_yaw": 0.5, "torque": -0.001, "fall": -7.0, "height": -1.5}
PUSH = EventConfig("push", interval_s=Distribution(1.0, 1.0), settings={"horizontal_m_s": 0.5})
TERMS = (("gyro", 1.0), ("command", 1.0), ("last_action", 1.0), ("joint_position", 2.0))
CONFIG = replace(
    SMOKE, control_rate_hz=40.0, substeps=SUBSTEPS, episode_s=10.0, speed_limit=50.0,
    observation=tuple(ObservationConfig(*term) for term in TERMS),
    rewards=tuple(RewardConfig(*term) for term in REWARDS.items()),
    events=(EventConfig("reset_pose"), PUSH), noise=Noise(joint_position=0.01),
    gait=GaitConfig("gallop", 2.0, 0.05),
    randomisation=Randomisation(observation_delay_s=Distribution(0.01, 0.01)),
)  # fmt: skip


def numbered_steps(motion: Motion, drive: Drive, _: Fields) -> tuple[Motion, Trace]:
    """In physics step k the base turns by k * TURN faster and the motors give (k + 1) * TORQUE.

    A foot is at 10 (foot + 1) + k cm along x and (foot + 1) cm up. The resulting motion contains the
    targets of the last step and the sum of all stiffness.
    """
    number = jnp.arange(1.0, SUBSTEPS + 1)
    qvel = jnp.tile(motion.qvel, (SUBSTEPS, 1)).at[:, 3:6].add(number[:, None] * TURN)
    qpos = jnp.tile(motion.qpos, (SUBSTEPS, 1))
    foot = jnp.arange(1.0, 5.0)
    x = 0.1 * foot[None] + 0.01 * number[:, None]
    feet = jnp.stack([x, jnp.zeros((SUBSTEPS, 4)), jnp.tile(0.01 * foot, (SUBSTEPS, 1))], axis=-1)
    carried = motion.qacc_warmstart.at[:N].set(drive.target[-1]).at[N].set(jnp.sum(drive.kp))
    end = Motion(qpos[-1], qvel[-1], carried)
    return end, Trace(qpos, qvel, feet, number[:, None] * jnp.asarray(TORQUE, jnp.float32))


def on_numbers(**changes: Any) -> LocomotionEnv:
    env = LocomotionEnv(ROBOT, replace(CONFIG, **changes))
    env.engine = env.engine._replace(simulate=numbered_steps)
    return env


@pytest.fixture(scope="module")
def env() -> LocomotionEnv:
    return on_numbers()


@pytest.fixture(scope="module")
def step(env: LocomotionEnv) -> Callable[..., tuple[State, Step]]:
    return jax.jit(env.step)


@pytest.fixture(scope="module")
def begun(env: LocomotionEnv) -> State:
    state, _ = jax.jit(env.reset)(jax.random.PRNGKey(5), jnp.float32(1.0))
    joints = ROBOT.default_pose + np.linspace(-0.2, 0.3, N)
    return state._replace(
        qpos=jnp.array([0.1, 0.2, 0.25, *TILTED.as_quat(scalar_first=True), *joints], jnp.float32),
        qvel=jnp.linspace(-0.4, 0.5, 18),
        command=jnp.array([0.4, -0.2, 0.3]), hold_steps=jnp.int32(7), event_steps={"push": jnp.int32(9)},
    )  # fmt: skip


ACTION = np.linspace(-0.3, 0.4, N, dtype=np.float32)


def placed(state: State, height_m: float = 0.3, tilt_rad: float = 0.0) -> State:
    """A state with the base at rest at this height and roll angle."""
    base = jnp.array([0.0, 0.0, height_m, np.cos(tilt_rad / 2), np.sin(tilt_rad / 2), 0.0, 0.0])
    return state._replace(qpos=state.qpos.at[:7].set(base), qvel=state.qvel.at[:6].set(0.0))


class TestStep:
    def test_a_goal_has_the_old_phase_and_command(self, env: LocomotionEnv, step, begun: State) -> None:
        """Goals are kept newest first, beside their actions."""
        expected = joint_target(ACTION, np.asarray(begun.phase), np.asarray(begun.command), env.contract)
        first, _ = step(begun, ACTION)
        np.testing.assert_allclose(first.goals[0], expected, atol=1e-6)
        np.testing.assert_array_equal(first.goals[1:], begun.goals[:-1])
        second, _ = step(first, -ACTION)
        np.testing.assert_array_equal(second.goals[1], first.goals[0])
        np.testing.assert_array_equal(second.actions, [-ACTION, ACTION, np.zeros(N)])
        assert float(begun.phase[0]) != float(first.phase[0])
        clock, _ = step(begun._replace(phase=jnp.array([0.97])), ACTION)
        np.testing.assert_allclose(clock.phase, [0.02], atol=1e-6)  # 0.97 + 2 Hz / 40 Hz, wrapped

    def test_the_actor_observes_delayed_readings(self, step, begun: State) -> None:
        """A delay of 10 ms is 1.6 physics steps: the reading is between the second and the third of four."""
        first, result = step(begun, ACTION)
        turns = np.asarray(begun.qvel[3:6]) + np.outer([1, 2, 2.4, 3, 4], TURN)
        np.testing.assert_allclose(result.observation["state"][:3], turns[2], rtol=1e-5)
        np.testing.assert_allclose(first.recent_readings[:, :3], turns[[0, 1, 3, 4]], rtol=1e-5)
        whole_period = first._replace(sample={"observation_delay_s": jnp.float32(0.025)})
        _, result = step(whole_period, ACTION)
        np.testing.assert_allclose(result.observation["state"][:3], turns[4], rtol=1e-5)

    def test_rewards_are_of_the_last_physics_step_and_old_command(self, step, begun: State) -> None:
        due = begun._replace(hold_steps=jnp.int32(0))
        after, result = step(due, ACTION)
        yaw_error = 0.3 - (float(begun.qvel[5]) + 4 * TURN[2])
        forward, left, _ = TILTED.inv().apply(np.asarray(begun.qvel[:3]))
        rewards = {
            "track_yaw": REWARDS["track_yaw"] * np.exp(-(yaw_error**2) / 0.25),
            "torque": REWARDS["torque"] * np.sum((4 * TORQUE) ** 2),
            "height": REWARDS["height"] * (0.25 - ROBOT.description.standing_height_m) ** 2,
            "fall": 0.0,
        }
        expected = {f"reward/{name}": value for name, value in rewards.items()} | {
            "tracking/linear_error_m_s": np.hypot(0.4 - forward, -0.2 - left),
            "tracking/yaw_error_rad_s": abs(yaw_error),
        }
        for name, value in expected.items():
            assert float(result.metrics[name]) == pytest.approx(value, rel=1e-4), name
        rate = max(sum(rewards.values()), CONFIG.reward_floor)
        assert float(result.reward) == pytest.approx(rate / 40.0, rel=1e-4)
        # The command is drawn in each step that is due, and observed at once; noise is drawn in each step.
        np.testing.assert_allclose(result.observation["state"][3:6], after.command)
        again, later = step(after._replace(hold_steps=jnp.int32(0)), ACTION)
        assert len({tuple(np.asarray(state.command)) for state in (due, after, again)}) == 3
        assert not np.array_equal(*(each.observation["state"][-N:] for each in (result, later)))

    def test_the_critic_sees_the_last_physics_step(self, env: LocomotionEnv, step, begun: State) -> None:
        after, result = step(begun, ACTION)
        actor, critic = (np.asarray(result.observation[name]) for name in ("state", "privileged_state"))
        np.testing.assert_array_equal(critic[: len(actor)], actor)
        clean, rest = np.split(critic[len(actor) :], [len(actor)])  # no term has a history
        gyro, position = begun.qvel[3:6] + 4 * TURN, after.qpos[7:] - ROBOT.default_pose
        expected = [*gyro, *after.command, *ACTION, *(2.0 * position)]
        np.testing.assert_allclose(clean, expected, rtol=1e-4, atol=1e-6)
        velocity, height, contact, clearance, torque, sampled = np.split(rest, np.cumsum([3, 1, 4, 4, N]))
        expected = TILTED.inv().apply(np.asarray(begun.qvel[:3]))
        np.testing.assert_allclose(velocity, expected, rtol=1e-4, atol=1e-6)
        assert (height, sampled) == (pytest.approx([0.25]), pytest.approx([0.01]))
        radius = np.array([MODEL.geom(foot.geoms[0]).size[0] for foot in ROBOT.description.feet])
        above = 0.01 * np.arange(1, 5) - radius
        np.testing.assert_allclose(clearance, 10 * above, rtol=1e-4, atol=1e-6)
        np.testing.assert_array_equal(contact, above < 0.002)
        assert 0 < contact.sum() < 4
        np.testing.assert_allclose(torque, 4 * TORQUE / ROBOT.motor.peak_torque, rtol=1e-5)

    def test_a_push_acts_after_the_reading_and_the_critic_observes_it(self, step, begun: State) -> None:
        after, _ = step(begun._replace(event_steps={"push": jnp.int32(0)}), ACTION)
        unpushed, _ = step(begun, ACTION)
        assert np.abs(np.asarray(after.qvel - unpushed.qvel)[:2]).max() > 0.01
        np.testing.assert_array_equal(after.recent_readings, unpushed.recent_readings)
        assert (int(after.event_steps["push"]), int(unpushed.event_steps["push"])) == (40, 8)
        assert (int(unpushed.hold_steps), int(after.steps)) == (6, int(begun.steps) + 1)

    def test_a_limp_robots_motors_only_damp_and_its_actions_do_not_count(self, step, begun: State) -> None:
        limp, _ = step(begun._replace(limp_steps=jnp.int32(1)), ACTION)
        np.testing.assert_array_equal(limp.actions[0], np.zeros(N))
        np.testing.assert_array_equal(limp.goals[0], begun.qpos[7:])
        awake, _ = step(limp, ACTION)
        np.testing.assert_array_equal(awake.actions[0], ACTION)
        stiffness = [float(state.qacc_warmstart[N]) for state in (limp, awake)]
        assert stiffness == pytest.approx([0.0, ROBOT.kp.sum()])

    def test_a_divergence_counts_as_a_fall_with_a_zero_observation(self, step, begun: State) -> None:
        _, result = step(begun._replace(qvel=begun.qvel.at[7].set(jnp.inf)), ACTION)
        assert float(result.reward) == pytest.approx(-7.0 / 40.0)
        assert (float(result.terminated), float(result.truncated)) == (1.0, 0.0)
        assert all(not np.any(leaf) for leaf in jax.tree.leaves(result.observation))
        assert {name for name, value in result.metrics.items() if float(value) != 0.0} == {"episode/diverged"}
        for speed, diverged in ((49.0, 0.0), (51.0, 1.0), (-51.0, 1.0)):  # the limit is 50
            _, result = step(placed(begun)._replace(qvel=begun.qvel.at[17].set(speed)), ACTION)
            assert float(result.metrics["episode/diverged"]) == float(result.terminated) == diverged

    def test_tilt_and_height_end_an_episode_and_so_does_the_time_limit(self, step, begun: State) -> None:
        """The limits are 0.55 of 0.2945 m: 0.162 m, and 10 s: 400 steps."""
        within, beyond = ((0.3, 1.05), (0.165, 0.0)), ((0.3, 1.15), (0.159, 0.0))
        for height_m, tilt_rad in (*within, *beyond):
            fell = float((height_m, tilt_rad) in beyond)
            _, result = step(placed(begun, height_m, tilt_rad), ACTION)
            assert float(result.metrics["episode/falls"]) == float(result.terminated) == fell
            assert float(result.metrics["reward/fall"]) == -7.0 * fell
        for steps, late in ((398, 0.0), (399, 1.0)):
            _, result = step(begun._replace(steps=jnp.int32(steps)), ACTION)
            assert (float(result.terminated), float(result.truncated)) == (0.0, late)


def test_the_sum_of_rewards_has_a_lower_limit_except_for_a_fall(begun: State) -> None:
    """`alive` is 1, `height` is below the limit of -0.5, and `fall` counts in full."""
    for height_weight, upright_rate, fallen_rate in ((0.0, 1.0, -7.0), (-1e6, -0.5, -7.5)):
        weights = {"alive": 1.0, "height": height_weight, "fall": -7.0}
        rewards = tuple(RewardConfig(*term) for term in weights.items())
        step = jax.jit(on_numbers(rewards=rewards, reward_floor=-0.5).step)
        for tilt_rad, rate in ((0.0, upright_rate), (3.0, fallen_rate)):
            _, result = step(placed(begun, tilt_rad=tilt_rad), ACTION)
            assert float(result.reward) == pytest.approx(rate / 40.0, rel=1e-5)


def test_step_data_are_those_of_the_last_physics_step(env: LocomotionEnv, begun: State) -> None:
    @jax.jit
    def after_step(state: State) -> Any:
        motion = Motion(state.qpos, state.qvel, state.qacc_warmstart)
        _, trace = numbered_steps(motion, env.actuation.drive(jnp.zeros((SUBSTEPS, N)), {}), {})
        return env.step_data(state, trace)._replace(scene=jnp.zeros(()))

    state = begun._replace(phase=jnp.array([0.15]), actions=jnp.arange(36.0).reshape(3, N))
    found = after_step(state)
    expected: dict[str, Any] = {
        "command": [0.4, -0.2, 0.3], "moving": 1.0,
        "linear_velocity": TILTED.inv().apply(np.asarray(begun.qvel[:3])),
        "angular_velocity": begun.qvel[3:6],
        "gravity": TILTED.inv().apply([0.0, 0.0, -1.0]), "height": 0.25,
        "joint_position": begun.qpos[7:], "joint_velocity": begun.qvel[6:], "torque": 4 * TORQUE,
        "actions": state.actions, "foot_speed": np.full(4, 0.01 / CONFIG.timestep_s), "fell": 0.0,
    }  # fmt: skip
    for name, value in expected.items():
        np.testing.assert_allclose(getattr(found, name), value, rtol=1e-4, atol=1e-5, err_msg=name)
    # A gallop, duty 0.35: the feet are at 0.15, 0.25, 0.35 and 0.45 of the cycle, and swings last 0.65.
    lifted = np.sin(np.pi * np.array([0.15, 0.25, 0.35, 0.45]) / 0.65)
    np.testing.assert_allclose(found.swing, lifted, atol=1e-5)


class TestReset:
    def test_an_episode_begins_with_full_timers_and_at_rest(self, env: LocomotionEnv) -> None:
        state, observation = jax.jit(env.reset)(jax.random.PRNGKey(8), jnp.float32(0.25))
        assert (float(state.level), int(state.steps), int(state.event_steps["push"])) == (0.25, 0, 40)
        hold = CONFIG.commands.hold_s
        assert hold.low * 40 <= int(state.hold_steps) <= hold.high * 40
        np.testing.assert_allclose(state.goals, np.tile(ROBOT.default_pose, (3, 1)), rtol=1e-6)
        readings = env.observer.readings(state.qpos, state.qvel, jnp.zeros(N))
        np.testing.assert_allclose(state.recent_readings, np.tile(readings, (SUBSTEPS, 1)), atol=1e-6)
        np.testing.assert_allclose(observation["state"][:3], state.qvel[3:6], atol=1e-6)
        np.testing.assert_allclose(observation["state"][3:6], state.command)
        restarted = jax.jit(env.restart)(state._replace(key=jax.random.PRNGKey(8)))
        jax.tree.map(partial(np.testing.assert_allclose, atol=1e-6), restarted, (state, observation))

    def test_each_episode_draws_everything_and_the_curricula_scale_it(self) -> None:
        starts = {"randomisation": 0.0, "commands": 0.2}
        curricula = tuple(CurriculumConfig("linear", of, settings={"start": s}) for of, s in starts.items())
        wide = {"randomisation": load_randomisation(), "curricula": curricula, "curriculum_steps": 100}
        env = LocomotionEnv(ROBOT, replace(SMOKE, **wide))
        assert [float(env.level(jnp.float32(steps))) for steps in (0, 50, 200)] == [0.0, 0.5, 1.0]
        reset = jax.jit(env.reset)
        nominal, half, full = (reset(jax.random.PRNGKey(12), level)[0] for level in (0.0, 0.5, 1.0))
        again, other = (reset(jax.random.PRNGKey(key), 1.0)[0] for key in (12, 2))
        jax.tree.map(np.testing.assert_array_equal, full, again)
        one, two = (state._asdict() | state.sample | state.fields for state in (full, other))
        drawn = ("qpos", "qvel", "phase", "history", "recent_readings", *full.sample, *full.fields)
        assert [name for name in drawn if np.array_equal(one[name], two[name])] == []
        assert min(abs(float(full.sample["payload_kg"])), np.abs(full.command).max()) > 0.1
        for found, expected in (
            (nominal.sample["link_mass"], 1.0), (nominal.sample["action_delay_s"], 0.0),
            (nominal.fields["body_mass"], MODEL.body_mass), (nominal.command, 0.2 * full.command),
            (half.sample["payload_kg"], full.sample["payload_kg"] / 2), (half.command, 0.6 * full.command),
        ):  # fmt: skip
            np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_the_contract_has_the_configured_values() -> None:
    ranges = CommandRange((-1, 2), (-3, 4), (-5, 6))
    commands = replace(CONFIG.commands, standing_command=0.17, ranges=ranges)
    config = replace(CONFIG, commands=commands, action_scale=0.5)
    contract = make_contract(ROBOT, config)
    assert (contract.robot, contract.digest, contract.joints) == ("go1", ROBOT.digest, ROBOT.joint_names)
    assert (contract.control_rate_hz, contract.standing_command) == (40.0, 0.17)
    terms = [(term.name, term.scale) for term in contract.observation]
    assert terms == [(term.term, term.scale) for term in config.observation]
    assert contract.commands == ranges
    found = (contract.kp, contract.kd, contract.action_scale_rad)
    np.testing.assert_array_equal(found, [ROBOT.kp, ROBOT.kd, 0.5 * ROBOT.action_scale])
    assert (contract.gait.frequency_hz, contract.gait.duty) == (2.0, 0.35)
    phases = np.array(contract.gait.phase)[np.array(ROBOT.foot_joints)]
    np.testing.assert_array_equal(phases, np.repeat([[0.0], [0.1], [0.2], [0.3]], 3, axis=1))
    lifted = ROBOT.default_pose + contract.gait.amplitude_rad
    before, after = (ROBOT.legs.pose(pose).foot for pose in (ROBOT.default_pose, lifted))
    np.testing.assert_allclose(after - before, np.tile([0.0, 0.0, 0.05], (4, 1)), atol=1e-4)
    assert not any(make_gait(ROBOT, GaitConfig("trot", 1.3)).amplitude_rad)
    assert make_contract(ROBOT, replace(CONFIG, gait=None)).gait is None


def test_physics_steps_are_as_short_as_joints_need() -> None:
    """Control steps of 25 ms and 125 ms are divided; go1's knees become unstable beyond 27 ms."""
    for rate_hz, substeps in ((40.0, 2), (10.0, 4)):
        on_numbers(control_rate_hz=rate_hz, substeps=substeps)
    for rate_hz, substeps in ((10.0, 2), (2.0, 4)):
        with pytest.raises(UserError, match=rf" {rate_hz:g} with {substeps} .*RL_calf_joint.*27\.1 ms"):
            on_numbers(control_rate_hz=rate_hz, substeps=substeps)


@pytest.mark.parametrize("on_host", [False, True])
def test_episodes_side_by_side_are_independent(on_host: bool) -> None:
    """Of each three episodes, the second ends by a fall, the third by the time limit."""

    def step(state: Any, action: jax.Array) -> tuple[Any, Step]:
        state = state._replace(steps=state.steps + 1, key=state.key + 100)
        fell, late = (state.key == 102.0) * 1.0, (state.steps == 9) * 1.0
        return state, Step({"state": state.key * jnp.ones(2)}, 10 * action, fell, late, {"a": action})

    def reset(key: jax.Array, level: jax.Array) -> tuple[Any, dict[str, jax.Array]]:
        return Fake(key + 1000, level, jnp.int32(0)), {"state": key * jnp.array([-1.0, -2.0])}

    def all_of(*of_three: Any) -> np.ndarray:
        """So many that the second pass of resets is not full. The first and the last episode run on."""
        return np.tile(of_three, (RESTARTS_PER_PASS - 5, *[1] * (np.ndim(of_three) - 1)))[:-2]

    Fake = NamedTuple("Fake", [("key", Any), ("level", Any), ("steps", Any)])  # noqa: UP014
    env: Any = SimpleNamespace(on_host=on_host, step=step, reset=reset)
    begun = Fake(*map(jnp.array, (all_of(1.0, 2.0, 3.0), all_of(0.1, 0.2, 0.3), all_of(3, 4, 8))))
    state, observation, last = step_batch(env, begun, jnp.array(all_of(0.5, 0.6, 0.7)))
    for found, expected in (
        (state.key, all_of(101, 1102, 1103)), (state.level, begun.level), (state.steps, all_of(4, 0, 0)),
        (observation["state"], all_of([101, 101], [-102, -204], [-103, -206])),
        (last.observation["state"][:, 0], all_of(101, 102, 103)), (last.reward, all_of(5, 6, 7)),
        (last.terminated, all_of(0, 1, 0)), (last.truncated, all_of(0, 0, 1)),
        (last.metrics["done"], all_of(0, 1, 1)), (last.metrics["length"], all_of(0, 5, 9)),
        (last.metrics["a"], all_of(0.5, 0.6, 0.7)),
    ):  # fmt: skip
        np.testing.assert_allclose(found, expected)

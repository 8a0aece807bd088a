"""One control step in numbers that all differ: what goes into the physics, what comes out, and in which
order.

The physics is a stand-in whose physics steps can be told apart, so that a step is plain arithmetic.
"""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import gymnasium
import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs import gymnasium_env
from footfall.envs.actuation import Actuation
from footfall.envs.base import Base
from footfall.envs.batch import step_batch
from footfall.envs.config import (
    CommandConfig,
    Curriculum,
    EnvConfig,
    GaitConfig,
    InitialState,
    PushConfig,
    RewardScales,
)
from footfall.envs.disturb import DISTURBANCE_NUMBERS, disturb
from footfall.envs.feet import Feet
from footfall.envs.gait import make_gait
from footfall.envs.gymnasium_env import Camera, GymnasiumEnv, GymnasiumVectorEnv
from footfall.envs.physics.interface import Drive, Fields, Motion, Trace, joint_effort
from footfall.envs.start import Start
from footfall.envs.state import State, Step
from footfall.envs.velocity import VelocityEnv, make_contract
from footfall.envs.workarounds.fewer_kernels import segment_sum
from footfall.envs.workarounds.undisturbed import UNDISTURBED
from footfall.policies.action import joint_target
from footfall.policies.contract import CommandRange, Term
from footfall.policies.observation import moving
from footfall.robots.actuator import JointCommand, Motor, joint_torque, motor_torque
from footfall.robots.description import load_robot
from footfall.robots.model import ground_friction, training_model
from footfall.train.config import load_preset

ROBOT = load_robot("go1")
SMOKE = load_preset("smoke").env
MODEL = training_model(ROBOT, SMOKE.timestep_s)
N, SUBSTEPS = 12, 4
TILTED = Rotation.from_euler("xyz", [0.3, -0.4, 2.0])
QUATERNION = TILTED.as_quat()[[3, 0, 1, 2]]
TORQUE = np.linspace(-3.0, 4.0, N)
TURN = np.array([0.3, -0.5, 0.7])  # rad/s more in each physics step

CONFIG = replace(
    SMOKE,
    observation=(Term("gyro"), Term("command"), Term("last_action"), Term("joint_position", 2.0)),
    rewards={"track_yaw": 0.5, "torque": -0.001, "fall": -7.0, "height": -1.5},
    control_rate_hz=40.0,
    substeps=SUBSTEPS,
    episode_s=10.0,
    noise=Noise(),
    gait=GaitConfig("gallop", 2.0, 0.05),
    pushes=PushConfig(Distribution(1.0, 1.0), horizontal_m_s=0.5),
    randomisation=Randomisation(observation_delay_s=Distribution(0.01, 0.01)),
)


def told_apart(motion: Motion, drive: Drive, _: Fields) -> tuple[Motion, Trace]:
    """In physics step k the base turns by k * TURN faster, the motors give (k + 1) * TORQUE, and a
    foot's place
    is 10 (foot + 1) + k cm along x and (foot + 1) cm up. The motion carries the targets of its last step
    on."""
    number = jnp.arange(1.0, SUBSTEPS + 1)
    qvel = jnp.tile(motion.qvel, (SUBSTEPS, 1)).at[:, 3:6].add(number[:, None] * TURN)
    qpos = jnp.tile(motion.qpos, (SUBSTEPS, 1))
    foot = jnp.arange(1.0, 5.0)
    x = 0.1 * foot[None] + 0.01 * number[:, None]
    feet = jnp.stack([x, jnp.zeros((SUBSTEPS, 4)), jnp.tile(0.01 * foot, (SUBSTEPS, 1))], axis=-1)
    end = Motion(qpos[-1], qvel[-1], motion.qacc_warmstart.at[:N].set(drive.target[-1]))
    return end, Trace(qpos, qvel, feet, number[:, None] * jnp.asarray(TORQUE, jnp.float32))


@pytest.fixture(scope="module")
def env() -> VelocityEnv:
    env = VelocityEnv(ROBOT, CONFIG)
    env.engine = env.engine._replace(simulate=told_apart)
    return env


@pytest.fixture(scope="module")
def step(env: VelocityEnv) -> Callable[..., tuple[State, Step]]:
    return jax.jit(env.step)


@pytest.fixture(scope="module")
def reset(env: VelocityEnv) -> Callable[..., tuple[State, dict[str, jax.Array]]]:
    compiled = jax.jit(env.reset)
    return lambda key, level=1.0: compiled(jax.random.PRNGKey(key), jnp.float32(level))


@pytest.fixture(scope="module")
def begun(reset) -> State:
    state, _ = reset(5)
    qpos = np.concatenate([[0.1, 0.2, 0.25], QUATERNION, ROBOT.default_pose + np.linspace(-0.2, 0.3, N)])
    return state._replace(
        qpos=jnp.asarray(qpos, jnp.float32),
        qvel=jnp.linspace(-0.4, 0.5, 18),
        command=jnp.array([0.4, -0.2, 0.3]),
        hold_steps=jnp.int32(7),
        push_steps=jnp.int32(9),
    )


ACTION = jnp.linspace(-0.3, 0.4, N)


class TestStep:
    def test_the_goal_is_the_actions_for_the_phase_and_command_before_the_step(
        self, env: VelocityEnv, step, begun: State
    ) -> None:
        """And goals are kept newest first, beside the actions that they come from."""
        expected = joint_target(
            np.asarray(ACTION), np.asarray(begun.phase), np.asarray(begun.command), env.contract
        )
        first, _ = step(begun, ACTION)
        np.testing.assert_allclose(first.goals[0], expected, atol=1e-6)
        np.testing.assert_array_equal(first.goals[1:], begun.goals[:-1])
        second, _ = step(first, -ACTION)
        np.testing.assert_array_equal(second.goals[1], first.goals[0])
        np.testing.assert_array_equal(second.actions, [-ACTION, ACTION, np.zeros(N)])
        assert float(begun.phase[0]) != float(first.phase[0])

    def test_the_motors_follow_its_targets(self, env: VelocityEnv, step, begun: State) -> None:
        after, _ = step(begun, ACTION)
        targets = env.actuation.targets(after.goals, begun.target, begun.sample)
        np.testing.assert_allclose(after.qacc_warmstart[:N], targets[-1], atol=1e-6)
        np.testing.assert_array_equal(after.target, after.qacc_warmstart[:N])

    def test_the_actor_sees_what_was_a_delay_ago(self, step, begun: State) -> None:
        """10 ms are 1.6 physics steps: between the second and the third of the four."""
        after, result = step(begun, ACTION)
        before = np.asarray(begun.qvel[3:6])
        np.testing.assert_allclose(result.observation["state"][:3], before + 2.4 * TURN, rtol=1e-5)
        np.testing.assert_allclose(
            after.recent_readings[:, :3], before + np.outer([1, 2, 3, 4], TURN), rtol=1e-5
        )

    def test_a_delay_of_a_whole_period_reaches_back_into_the_step_before(self, step, begun: State) -> None:
        first, _ = step(begun, ACTION)
        late = first._replace(sample={"observation_delay_s": jnp.float32(0.025)})
        _, result = step(late, ACTION)
        np.testing.assert_allclose(result.observation["state"][:3], first.recent_readings[-1, :3], rtol=1e-5)

    def test_the_rewards_are_of_the_last_physics_step_and_of_the_old_command(
        self, step, begun: State
    ) -> None:
        due = begun._replace(hold_steps=jnp.int32(0))
        after, result = step(due, ACTION)
        yaw_rate = float(begun.qvel[5]) + 4 * TURN[2]
        weights, scales = CONFIG.rewards, CONFIG.reward_scales
        expected = {
            "track_yaw": weights["track_yaw"] * np.exp(-((0.3 - yaw_rate) ** 2) / scales.yaw_sigma_rad2_s2),
            "torque": weights["torque"] * np.sum((4 * TORQUE) ** 2),
            "height": weights["height"] * (0.25 - ROBOT.description.standing_height_m) ** 2,
            "fall": 0.0,
        }
        for name, value in expected.items():
            assert float(result.metrics[f"reward/{name}"]) == pytest.approx(value, rel=1e-4), name
        rate = max(sum(expected.values()), scales.least)
        assert float(result.reward) == pytest.approx(rate / 40.0, rel=1e-4)
        assert not np.array_equal(after.command, due.command)
        np.testing.assert_allclose(
            result.observation["state"][3:6], after.command
        )  # it is told of the new one
        forward, left = TILTED.inv().apply(np.asarray(begun.qvel[:3]))[:2]
        error = np.hypot(0.4 - forward, -0.2 - left)
        assert float(result.metrics["tracking/linear_error_m_s"]) == pytest.approx(error, rel=1e-4)
        assert float(result.metrics["tracking/yaw_error_rad_s"]) == pytest.approx(
            abs(0.3 - yaw_rate), rel=1e-4
        )

    def test_the_critic_is_told_of_feet_and_torques_of_the_last_physics_step(
        self, env: VelocityEnv, step, begun: State
    ) -> None:
        after, result = step(begun, ACTION)
        actor, critic = (np.asarray(result.observation[name]) for name in ("state", "privileged_state"))
        np.testing.assert_array_equal(critic[: len(actor)], actor)
        clean, rest = np.split(critic[len(actor) :], [len(actor)])  # no term has a history
        position = np.asarray(after.qpos[7:]) - ROBOT.default_pose
        np.testing.assert_allclose(
            clean, [*(np.asarray(begun.qvel[3:6]) + 4 * TURN), *after.command, *ACTION,
            *(2.0 * position)], rtol=1e-4,
            atol=1e-6,
        )  # fmt: skip
        velocity, height, contact, clearance, torque, sampled = np.split(rest, np.cumsum([3, 1, 4, 4, N]))
        np.testing.assert_allclose(
            velocity, TILTED.inv().apply(np.asarray(begun.qvel[:3])), rtol=1e-4, atol=1e-6
        )
        assert height == pytest.approx([0.25])
        radius = np.array([MODEL.geom(foot.geoms[0]).size[0] for foot in ROBOT.description.feet])
        above = 0.01 * np.arange(1, 5) - radius
        np.testing.assert_allclose(clearance, 10 * above, rtol=1e-4, atol=1e-6)
        np.testing.assert_array_equal(contact, above < 0.002)
        assert 0 < contact.sum() < 4
        np.testing.assert_allclose(torque, 4 * TORQUE / ROBOT.motor.peak_torque, rtol=1e-5)
        assert sampled == pytest.approx([0.01])

    def test_a_push_is_felt_after_the_reading_and_seen_by_the_critic(self, step, begun: State) -> None:
        after, _ = step(begun._replace(push_steps=jnp.int32(0)), ACTION)
        unpushed, _ = step(begun, ACTION)
        assert np.abs(np.asarray(after.qvel - unpushed.qvel)[:2]).max() > 0.01
        np.testing.assert_array_equal(after.recent_readings, unpushed.recent_readings)
        assert (int(after.push_steps), int(unpushed.push_steps)) == (40, 8)
        assert int(unpushed.hold_steps) == 6
        assert int(after.steps) == int(begun.steps) + 1

    def test_a_divergence_earns_a_fall_and_tells_nothing(self, step, begun: State) -> None:
        _, result = step(begun._replace(qvel=begun.qvel.at[7].set(jnp.inf)), ACTION)
        assert float(result.reward) == pytest.approx(-7.0 / 40.0)
        assert (float(result.terminated), float(result.truncated)) == (1.0, 0.0)
        assert all(not np.any(leaf) for leaf in jax.tree.leaves(result.observation))
        assert {name for name, value in result.metrics.items() if float(value) != 0.0} == {"episode/diverged"}


@pytest.mark.parametrize("on_host", [False, True])
def test_episodes_side_by_side_are_each_their_own(on_host: bool) -> None:
    """Three that all differ; the second and the third end, one by a fall and one by the time."""

    def step(state: Any, action: jax.Array) -> tuple[Any, Step]:
        state = state._replace(steps=state.steps + 1, key=state.key + 100)
        observation = {"state": state.key * jnp.ones(2)}
        fell, late = (state.key == 102.0) * 1.0, (state.steps == 9) * 1.0
        return state, Step(observation, 10 * action, fell, late, {"a": action})

    def reset(key: jax.Array, level: jax.Array) -> tuple[Any, dict[str, jax.Array]]:
        return NewState(key + 1000, level, jnp.int32(0)), {"state": key * jnp.array([-1.0, -2.0])}

    NewState = NamedTuple("NewState", [("key", Any), ("level", Any), ("steps", Any)])  # noqa: UP014
    env: Any = SimpleNamespace(engine=SimpleNamespace(on_host=on_host), step=step, reset=reset)
    begun = NewState(jnp.array([1.0, 2.0, 3.0]), jnp.array([0.1, 0.2, 0.3]), jnp.array([3, 4, 8]))
    state, observation, last = step_batch(env, begun, jnp.array([0.5, 0.6, 0.7]))
    np.testing.assert_allclose(state.key, [101, 1102, 1103])
    np.testing.assert_allclose(state.level, [0.1, 0.2, 0.3])
    assert state.steps.tolist() == [4, 0, 0]
    np.testing.assert_allclose(observation["state"], [[101, 101], [-102, -204], [-103, -206]])
    np.testing.assert_allclose(last.observation["state"][:, 0], [101, 102, 103])
    np.testing.assert_allclose(last.reward, [5, 6, 7])
    assert (last.terminated.tolist(), last.truncated.tolist()) == ([0, 1, 0], [0, 0, 1])
    assert last.metrics["done"].tolist() == [0, 1, 1]
    assert last.metrics["length"].tolist() == [0, 5, 9]
    np.testing.assert_allclose(last.metrics["a"], [0.5, 0.6, 0.7])


@pytest.fixture(scope="module")
def outcome(env: VelocityEnv) -> Callable[[State], Any]:
    """What the stand-in physics makes of a state, its motors at rest."""

    @jax.jit
    def of(state: State) -> Any:
        motion = Motion(state.qpos, state.qvel, state.qacc_warmstart)
        _, trace = told_apart(motion, env.actuation.drive(jnp.zeros((SUBSTEPS, N)), {}), {})
        return env.reward_inputs(state, trace)

    return of


class TestRewardInputs:
    @pytest.mark.parametrize(("share", "fell"), [(0.56, 0.0), (0.54, 1.0)])
    def test_a_base_below_its_share_of_the_standing_height_has_sunk(
        self, outcome: Callable[[State], Any], begun: State, share: float, fell: float
    ) -> None:
        height = share * ROBOT.description.standing_height_m
        assert float(outcome(begun._replace(qpos=begun.qpos.at[2].set(height))).fell) == fell

    def test_all_of_it_is_where_it_belongs(self, outcome: Callable[[State], Any], begun: State) -> None:
        state = begun._replace(phase=jnp.array([0.15]), actions=jnp.arange(36.0).reshape(3, N))
        found = outcome(state)
        expected: dict[str, Any] = {
            "command": [0.4, -0.2, 0.3], "moving": 1.0,
            "linear_velocity": TILTED.inv().apply(np.asarray(begun.qvel[:3])),
            "angular_velocity": begun.qvel[3:6],
            "gravity": TILTED.inv().apply([0.0, 0.0, -1.0]), "height": 0.25,
            "standing_height": ROBOT.description.standing_height_m, "joint_position": begun.qpos[7:],
            "joint_velocity": begun.qvel[6:], "default_pose": ROBOT.default_pose,
            "soft_lower": ROBOT.soft_limits[0], "soft_upper": ROBOT.soft_limits[1], "torque": 4 * TORQUE,
            "actions": state.actions, "foot_speed": np.full(4, 0.01 / CONFIG.timestep_s), "fell": 0.0,
        }  # fmt: skip
        for name, value in expected.items():
            np.testing.assert_allclose(getattr(found, name), value, rtol=1e-4, atol=1e-5, err_msg=name)
        # A gallop, duty 0.4: the feet are at 0.55, 0.65, 0.15 and 0.25 of the cycle, and swings last 0.6.
        lifted = np.sin(np.pi * np.array([0.55, 0.6, 0.15, 0.25]) / 0.6)
        np.testing.assert_allclose(found.swing, lifted, atol=1e-5)


class TestReset:
    def test_an_episode_begins_at_rest_in_time(self, env: VelocityEnv, reset) -> None:
        state, observation = reset(8, 0.25)
        assert (float(state.level), int(state.steps), int(state.push_steps)) == (0.25, 0, 40)
        hold = CONFIG.commands.hold_s
        assert hold.low * 40 <= int(state.hold_steps) <= hold.high * 40
        assert state.goals.shape == (3, N)
        np.testing.assert_allclose(state.goals, np.tile(ROBOT.default_pose, (3, 1)), rtol=1e-6)
        readings = env.observer.readings(state.qpos, state.qvel, jnp.zeros(N))
        np.testing.assert_allclose(state.recent_readings, np.tile(readings, (SUBSTEPS, 1)), atol=1e-6)
        np.testing.assert_allclose(observation["state"][:3], state.qvel[3:6], atol=1e-6)
        np.testing.assert_allclose(observation["state"][3:6], state.command)
        told = np.asarray(observation["privileged_state"][2 * len(observation["state"]) :])
        np.testing.assert_array_equal(
            told[4 : 4 + 4 + 4 + N], np.zeros(4 + 4 + N)
        )  # feet and torques: not yet

    def test_keys_draw_apart_what_they_draw(self, reset) -> None:
        states = [reset(key)[0] for key in range(60)]
        assert len({tuple(np.asarray(state.key).tolist()) for state in states}) == 60
        phases = np.sort([float(state.phase[0]) for state in states])
        assert np.abs(phases - (np.arange(60) + 0.5) / 60).max() < 0.2  # the clock begins anywhere
        numbers = np.array([[s.command[0], s.qvel[0], s.phase[0], s.hold_steps] for s in states])
        assert np.abs(np.corrcoef(numbers.T) - np.eye(4)).max() < 0.4

    def test_the_nominal_friction_is_the_grounds(self) -> None:
        wide = Randomisation(friction=Distribution(0.1, 0.3), kp=Distribution(0.5, 0.6))
        env = VelocityEnv(
            ROBOT, replace(CONFIG, curriculum=Curriculum(10, randomisation=0.0), randomisation=wide)
        )
        nominal, full = (env._draw_robot(jax.random.PRNGKey(1), level) for level in (0.0, 1.0))
        assert float(nominal["friction"]) == pytest.approx(ground_friction(MODEL, ROBOT).mean())
        np.testing.assert_allclose(nominal["kp"], np.ones(N))
        assert 0.1 <= float(full["friction"]) <= 0.3

    def test_a_batch_changes_its_level_and_nothing_else(self, env: VelocityEnv, begun: State) -> None:
        batch = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), begun)
        moved = env.at_level(batch, jnp.float32(0.4))
        np.testing.assert_allclose(moved.level, [0.4, 0.4])
        assert all(a is b for a, b in zip(moved._replace(level=0), batch._replace(level=0), strict=True))


def test_the_contract_says_what_was_configured() -> None:
    config = replace(
        CONFIG,
        commands=replace(
            CONFIG.commands, standing_command=0.17, ranges=CommandRange((-1, 2), (-3, 4), (-5, 6))
        ),
    )
    contract = make_contract(ROBOT, config)
    assert (contract.robot, contract.digest, contract.joints) == ("go1", ROBOT.digest, ROBOT.joint_names)
    assert (contract.control_rate_hz, contract.standing_command) == (40.0, 0.17)
    assert contract.observation == config.observation
    assert contract.commands == config.commands.ranges
    for name, values in (
        ("default_pose_rad", ROBOT.default_pose), ("action_scale_rad", ROBOT.action_scale), ("kp",
        ROBOT.kp), ("kd", ROBOT.kd),
    ):  # fmt: skip
        np.testing.assert_array_equal(getattr(contract, name), values)
    assert contract.gait is not None
    assert contract.gait.frequency_hz == 2.0
    assert contract.gait.duty == 0.4
    phases = np.array(contract.gait.phase)[np.array(ROBOT.foot_joints)]
    np.testing.assert_array_equal(phases, np.repeat([[0.4], [0.5], [0.0], [0.1]], 3, axis=1))
    assert not any(make_gait(ROBOT, GaitConfig("trot", 1.3)).amplitude_rad)
    assert make_contract(ROBOT, replace(CONFIG, gait=None)).gait is None
    assert float(moving(np.array([0.1, 0.1, 0.1]), contract)[0]) == 1.0


class TestBase:
    def test_a_base_that_is_tilted_about_all_axes_moves_as_mujoco_says(self) -> None:
        data = mujoco.MjData(MODEL)
        data.qpos[:7] = [1.0, 2.0, 0.4, *QUATERNION]
        data.qvel[:6] = [0.7, -0.3, 0.5, 0.2, -0.6, 0.9]
        mujoco.mj_forward(MODEL, data)
        body, local = MODEL.body(ROBOT.description.base).id, np.zeros(6)
        mujoco.mj_objectVelocity(MODEL, data, mujoco.mjtObj.mjOBJ_XBODY, body, local, 1)
        base = Base(MODEL, ROBOT)
        qpos, qvel = jnp.asarray(data.qpos, jnp.float32), jnp.asarray(data.qvel, jnp.float32)
        np.testing.assert_allclose(base.angular_velocity(qvel), local[:3], atol=1e-6)
        np.testing.assert_allclose(base.linear_velocity(qpos, qvel), local[3:], atol=1e-6)
        np.testing.assert_allclose(base.gravity(qpos), -data.xmat[body].reshape(3, 3)[2], atol=1e-6)
        np.testing.assert_allclose(base.position(qpos), [1.0, 2.0, 0.4])

    def test_what_is_changed_of_it_is_that_alone(self) -> None:
        base, qpos, qvel = Base(MODEL, ROBOT), jnp.arange(19.0), jnp.arange(18.0)
        turned = np.asarray(base.turned(qpos, jnp.array([0.1, 0.2, 0.3, 0.4])))
        np.testing.assert_allclose(turned, [0, 1, 2, 0.1, 0.2, 0.3, 0.4, *range(7, 19)], rtol=1e-6)
        moving_so = base.moving(qvel, jnp.array([-1.0, -2.0]), jnp.float32(-3.0))
        np.testing.assert_array_equal(moving_so, [-1, -2, 2, 3, 4, -3, *range(6, 18)])
        pushed = base.pushed(qvel, jnp.array([0.5, 0.25, 2.0, 4.0, 8.0, 16.0]))
        np.testing.assert_array_equal(pushed, [0.5, 1.25, 4, 7, 12, 21, *range(6, 18)])


def test_every_number_of_a_start_moves_its_own_part() -> None:
    initial = InitialState(0.11, 0.12, 0.13, 0.14, 0.15)
    start = Start(MODEL, ROBOT, initial)
    assert start.numbers == 31
    u = np.random.default_rng(4).random(31)
    qpos, qvel = (np.asarray(part) for part in start.draw(jnp.asarray(u, jnp.float32)))
    w = 2 * u - 1
    tilt = np.array([1.0, 0.06 * w[1], 0.06 * w[2], 0.0])
    attitude = Rotation.from_euler("z", np.pi * w[0]) * Rotation.from_quat(tilt[[1, 2, 3, 0]])
    np.testing.assert_allclose(
        Rotation.from_quat(qpos[[4, 5, 6, 3]]).as_matrix(), attitude.as_matrix(), atol=1e-5
    )
    np.testing.assert_allclose(qpos[:3], [0.0, 0.0, ROBOT.description.standing_height_m])
    np.testing.assert_allclose(qpos[7:], ROBOT.default_pose + 0.11 * w[7:19], atol=1e-6)
    np.testing.assert_allclose(qvel, [*(0.13 * w[3:5]), 0, 0, 0, 0.14 * w[5], *(0.15 * w[19:])], atol=1e-6)


class TestActuation:
    @pytest.mark.parametrize(
        ("steps", "new"), [(0.0, [1, 1, 1, 1]), (1.0, [0, 1, 1, 1]), (2.25, [0, 0, 0.75, 1])]
    )
    def test_a_goal_reaches_the_motors_when_its_delay_is_over(self, steps: float, new: list[float]) -> None:
        """In physics steps; of the step within which it arrives the goal has the rest."""
        default = jnp.asarray(ROBOT.default_pose, jnp.float32)
        goals = jnp.stack(
            [default + 1e-3, default, default]
        )  # so near that the target's rate does not matter
        delay_s = jnp.float32(steps * CONFIG.timestep_s)
        targets = np.asarray(Actuation(ROBOT, CONFIG).targets(goals, default, {"action_delay_s": delay_s}))
        expected = ROBOT.default_pose + 1e-3 * np.array(new)[:, None]
        np.testing.assert_allclose(targets, expected, atol=2e-6)

    def test_each_joint_has_its_own_limits_rate_and_gains(self) -> None:
        actuation = Actuation(ROBOT, CONFIG)
        lower, upper = ROBOT.soft_limits
        default = jnp.asarray(ROBOT.default_pose, jnp.float32)
        away = np.where(np.arange(N) % 2, 50.0, -50.0)
        goals = jnp.asarray(np.stack([ROBOT.default_pose + away] * 3), jnp.float32)
        targets = np.asarray(actuation.targets(goals, default, {}))
        rate = ROBOT.description.target_rate_rad_s * CONFIG.timestep_s
        for k in range(SUBSTEPS):
            expected = np.clip(ROBOT.default_pose + np.sign(away) * rate * (k + 1), lower, upper)
            np.testing.assert_allclose(targets[k], expected, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(actuation.peak_torque, ROBOT.motor.peak_torque, rtol=1e-6)

    def test_a_sampled_robots_drive_is_joint_by_joint(self) -> None:
        rng = np.random.default_rng(5)
        names = ("kp", "kd", "motor_strength", "joint_friction", "joint_damping", "encoder_bias")
        sample = {name: jnp.asarray(rng.uniform(0.5, 1.5, N), jnp.float32) for name in names}
        targets = jnp.asarray(rng.normal(size=(SUBSTEPS, N)), jnp.float32)
        drive = Actuation(ROBOT, CONFIG).drive(targets, sample)
        np.testing.assert_array_equal(drive.target, targets)
        np.testing.assert_allclose(drive.kp, ROBOT.kp * np.asarray(sample["kp"]), rtol=1e-5)
        np.testing.assert_allclose(drive.kd, ROBOT.kd * np.asarray(sample["kd"]), rtol=1e-5)
        np.testing.assert_array_equal(drive.encoder_bias, sample["encoder_bias"])
        np.testing.assert_allclose(drive.motor.strength, sample["motor_strength"], rtol=1e-5)
        np.testing.assert_allclose(
            drive.motor.damping, ROBOT.motor.damping + np.asarray(sample["joint_damping"]), rtol=1e-5
        )

    @pytest.mark.parametrize(
        ("name", "high", "complaint"),
        [
            ("action_delay_s", 0.05, ""), ("action_delay_s", 0.051, "must be at most 0.05 s, not 0.051"),
            ("observation_delay_s", 0.025, ""),
            ("observation_delay_s", 0.026, "must be at most 0.025 s, not 0.026"),
        ],
    )  # fmt: skip
    def test_delays_fit_the_buffers(self, name: str, high: float, complaint: str) -> None:
        """Three goals are kept and two control steps' readings, of 25 ms each."""
        config = replace(CONFIG, randomisation=Randomisation(**{name: Distribution(0.0, high)}))
        if not complaint:
            VelocityEnv(ROBOT, config)
        else:
            with pytest.raises(UserError, match=f"{name}: {complaint}"):
                VelocityEnv(ROBOT, config)


@pytest.mark.parametrize(
    ("rate_hz", "substeps", "fits"), [(40.0, 2, True), (10.0, 4, True), (10.0, 2, False), (2.0, 4, False)]
)
def test_physics_steps_are_no_longer_than_the_joints_are_stable_at(
    rate_hz: float, substeps: int, fits: bool
) -> None:
    """12.5 and 25 ms, 50 and 125 ms; go1's knees swing up beyond 27 ms."""
    config = replace(CONFIG, control_rate_hz=rate_hz, substeps=substeps)
    if fits:
        VelocityEnv(ROBOT, config)
        return
    with pytest.raises(
        UserError, match=r"RL_calf_joint of go1 is too stiff for steps beyond 27\.1 ms"
    ) as refused:
        VelocityEnv(ROBOT, config)
    assert f"control_rate_hz {rate_hz:g} with {substeps} substeps" in str(refused.value)


def test_the_joint_law_of_a_physics_step_is_the_motors_on_their_own_encoders() -> None:
    """And the added inertia is half a step of its slope in velocity, here by differences."""
    rng = np.random.default_rng(6)
    motor = Motor(*(np.asarray(part) * rng.uniform(0.5, 1.5, N) for part in ROBOT.motor))
    motor = motor._replace(damping=rng.uniform(0.1, 0.2, N))
    bias, target, position = 0.05 * rng.normal(size=(3, N))
    velocity = rng.uniform(0.5, 2.0, N)
    drive = Drive(np.zeros((1, N)), 20 * rng.uniform(0.5, 1.5, N), rng.uniform(0.5, 1.5, N), motor, bias)
    effort = joint_effort(drive, target, position, velocity, 0.004)
    command = JointCommand(target, 0.0, drive.kp, drive.kd, 0.0)
    np.testing.assert_allclose(effort.motor_torque, motor_torque(command, position + bias, velocity, motor))
    np.testing.assert_allclose(effort.torque, joint_torque(command, position + bias, velocity, motor))
    slope = (
        joint_torque(command, position + bias, velocity + 1e-6, motor)
        - joint_torque(command, position + bias, velocity - 1e-6, motor)
    ) / 2e-6
    np.testing.assert_allclose(effort.inertia, -0.5 * 0.004 * slope, rtol=1e-5)


def test_what_is_due_at_once_leaves_what_is_not_alone(begun: State) -> None:
    base, u = Base(MODEL, ROBOT), jnp.linspace(0.05, 0.95, DISTURBANCE_NUMBERS)
    for hold, push in ((0, 5), (5, 0), (-1, -1)):
        after = disturb(
            begun._replace(hold_steps=jnp.int32(hold), push_steps=jnp.int32(push)), u, CONFIG, base
        )
        assert np.array_equal(after.command, begun.command) == (hold > 0)
        assert np.array_equal(after.qvel, begun.qvel) == (push > 0)
        assert (int(after.hold_steps) == hold - 1) == (hold > 0)
        assert (int(after.push_steps) == push - 1) == (push > 0)


def test_feet_of_two_sizes_have_each_its_own_clearance() -> None:
    model = training_model(ROBOT, 0.005)
    geoms = [model.geom(foot.geoms[0]).id for foot in ROBOT.description.feet]
    model.geom_size[geoms, 0] = [0.01, 0.02, 0.03, 0.04]
    feet = Feet(model, ROBOT, 0.005, None)
    np.testing.assert_allclose(feet.clearance(jnp.full((4, 3), 0.05)), [0.04, 0.03, 0.02, 0.01], rtol=1e-5)
    assert feet.count == 4
    assert not feet.planned_swing(jnp.array([0.2]), jnp.float32(1.0)).any()  # without a gait


RANGES = CommandRange((-1.0, 1.0), (-0.5, 0.5), (-1.0, 1.0))


class TestSettings:
    @pytest.mark.parametrize(
        "make",
        [
            lambda: GaitConfig("trot", 0.0), lambda: GaitConfig("trot", 2.0, -0.01),
            lambda: CommandConfig(RANGES, Distribution(0.0, 1.0)), lambda: CommandConfig(RANGES,
            standing_command=-0.1),
            lambda: CommandConfig(RANGES, standing_probability=1.1),
            lambda: CommandConfig(RANGES, standing_probability=-0.1),
            lambda: CommandConfig(RANGES, single_axis_probability=1.1),
            lambda: CommandConfig(CommandRange((1.0, -1.0), (0.0, 0.0), (0.0, 0.0))),
            lambda: CommandConfig(CommandRange((0.0, 0.0), (1.0, -1.0), (0.0, 0.0))),
            lambda: CommandConfig(CommandRange((0.0, 0.0), (0.0, 0.0), (1.0, -1.0))),
            *(lambda k=k: InitialState(*np.where(np.arange(5) == k, -0.1, 0.0)) for k in range(5)),
            lambda: PushConfig(Distribution(0.0, 1.0)), lambda: PushConfig(horizontal_m_s=-0.1),
            lambda: PushConfig(vertical_m_s=-0.1), lambda: PushConfig(angular_rad_s=-0.1),
            lambda: Curriculum(-1), lambda: Curriculum(1, commands=1.1), lambda: Curriculum(1, pushes=-0.1),
            lambda: Curriculum(1, randomisation=1.1), lambda: RewardScales(linear_sigma_m2_s2=0.0),
            lambda: RewardScales(yaw_sigma_rad2_s2=0.0), lambda: RewardScales(swing_height_m=0.0),
            *(
                lambda change=change: replace(CONFIG, **change)
                for change in (
                    {"control_rate_hz": 0.9}, {"control_rate_hz": 1000.1}, {"episode_s": 0.0},
                    {"tilt_limit_rad": 0.0},
                    {"speed_limit": 0.0}, {"least_height_share": -0.1}, {"least_height_share": 1.1},
                    {"substeps": 1},
                    {"episode_s": 0.0249},
                )
            ),
        ],
    )  # fmt: skip
    def test_what_cannot_be_is_refused(self, make: Callable[[], object]) -> None:
        with pytest.raises(ValueError, match=r"must be|shorter than"):
            make()

    @pytest.mark.parametrize(
        "change",
        [
            {"control_rate_hz": 1000.0}, {"control_rate_hz": 1.0}, {"episode_s": 0.025}, {"substeps": 2},
            {"least_height_share": 0.0}, {"least_height_share": 1.0},
            {"curriculum": Curriculum(5, 0.0, 1.0, 0.0)}, {"gait": GaitConfig("trot", 0.1)},
            {"commands": CommandConfig(RANGES, standing_probability=1.0, single_axis_probability=0.0)},
        ],
    )  # fmt: skip
    def test_what_just_can_be_is_taken(self, change: dict[str, Any]) -> None:
        assert isinstance(replace(CONFIG, **change), EnvConfig)

    def test_a_physics_step_is_a_share_of_the_control_period(self) -> None:
        assert CONFIG.timestep_s == pytest.approx(0.00625)
        assert MODEL.opt.timestep == pytest.approx(0.005)


class TestGymnasium:
    """The faces of the environment, with the environment itself stood in for."""

    @pytest.fixture
    def renderer(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """What was rendered: positions, and where the camera looked from how far."""
        seen: list[Any] = []

        class Renderer:
            def __init__(self, _: object, height: int, width: int) -> None:
                seen.append(("made", height, width))

            def update_scene(self, data: mujoco.MjData, view: mujoco.MjvCamera) -> None:
                seen.append((data.qpos.copy(), view.lookat.copy(), view.distance))

            def render(self) -> np.ndarray:
                return np.full((1, 1, 3), len(seen), np.uint8)

            def close(self) -> None:
                seen.append(("closed",))

        monkeypatch.setattr(gymnasium_env.mujoco, "Renderer", Renderer)
        return seen

    def test_the_camera_goes_along_and_is_made_once(self, renderer: list[Any]) -> None:
        camera = Camera(ROBOT)
        assert renderer == []
        qpos = np.concatenate([[3.0, -2.0, 0.5], QUATERNION, np.linspace(-0.2, 0.2, N)])
        first, second = camera.picture(np.zeros(19) + np.eye(19)[3]), camera.picture(qpos)
        assert renderer[0] == ("made", gymnasium_env.HEIGHT, gymnasium_env.WIDTH)
        assert len(renderer) == 3
        np.testing.assert_allclose(renderer[2][0], qpos)
        np.testing.assert_allclose(renderer[2][1], [3.0, -2.0, 0.5])
        assert renderer[2][2] == pytest.approx(5 * ROBOT.description.standing_height_m)
        assert (first[0, 0, 0], second[0, 0, 0]) == (2, 3)
        camera.close()
        camera.close()
        assert renderer[3:] == [("closed",)]
        camera.picture(qpos)
        assert renderer[4] == ("made", gymnasium_env.HEIGHT, gymnasium_env.WIDTH)

    def test_each_robot_has_a_picture_of_its_own(self, renderer: list[Any]) -> None:
        many = GymnasiumVectorEnv(ROBOT, SMOKE, 2, "rgb_array")
        assert many.render() is None  # nothing has begun
        places = np.zeros((2, 19))
        places[:, 0], places[:, 3] = [1.0, 2.0], 1.0
        many._state = type("S", (), {"qpos": places})()
        assert len(many.render() or ()) == 2
        assert [each[0][0] for each in renderer[1:]] == [1.0, 2.0]
        many.close()
        assert renderer[-1] == ("closed",)

    def test_nothing_is_shown_unless_asked_for(self, renderer: list[Any]) -> None:
        one = GymnasiumEnv(ROBOT, SMOKE)
        one._state = type("S", (), {"qpos": np.zeros(19)})()
        assert one.render() is None
        assert one.metadata["render_fps"] == 50
        assert GymnasiumVectorEnv(ROBOT, replace(SMOKE, control_rate_hz=25.0)).metadata["render_fps"] == 25
        assert gymnasium.Env.metadata.get("render_fps") is None

    def test_information_is_of_the_episodes_that_go_on_and_of_those_that_ended(self) -> None:
        last = gymnasium_env.StepResult(
            np.arange(6.0).reshape(3, 2), np.zeros(3), np.array([False, True, False]), np.array([False,
            False, True]),
            {"command": np.arange(9.0).reshape(3, 3), "error": np.array([0.1, 0.2, 0.3])},
        )  # fmt: skip
        info = gymnasium_env.gathered(last, 100 + np.arange(9.0).reshape(3, 3))
        np.testing.assert_array_equal(info["command"], 100 + np.arange(9.0).reshape(3, 3))
        assert info["_command"].all()
        assert (info["error"].tolist(), info["_error"].tolist()) == ([0.1, 0.0, 0.0], [True, False, False])
        assert [None if row is None else row.tolist() for row in info["final_obs"]] == [
            None,
            [2.0, 3.0],
            [4.0, 5.0],
        ]
        assert info["_final_obs"].tolist() == info["_final_info"].tolist() == [False, True, True]
        assert info["final_info"]["error"].tolist() == [0.0, 0.2, 0.3]
        assert info["final_info"]["command"].tolist() == [[0.0] * 3, [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]]
        quiet = last._replace(terminated=np.zeros(3, bool), truncated=np.zeros(3, bool))
        assert set(gymnasium_env.gathered(quiet, last.info["command"])) == {
            "command",
            "_command",
            "error",
            "_error",
        }


def test_rows_of_other_segments_are_no_part_of_a_sum_over_one() -> None:
    rows = jnp.array([[1.0, 2.0], [10.0, 20.0], [100.0, 200.0]])
    for ids, total in (([0, 0, 0], [111.0, 222.0]), ([0, 1, 0], [101.0, 202.0])):
        np.testing.assert_allclose(segment_sum(rows, np.array(ids), 1), [total])


def test_mujoco_is_undisturbed_until_the_last_of_those_inside_has_left() -> None:
    before = mujoco.get_mju_user_warning()
    with UNDISTURBED:
        inside = mujoco.get_mju_user_warning()
        assert inside is not before
        with UNDISTURBED:
            assert mujoco.get_mju_user_warning() is inside
        assert mujoco.get_mju_user_warning() is inside  # the first is still inside
    assert mujoco.get_mju_user_warning() is before

"""The parts of the environment, one by one, against values worked out by hand or by plain MuJoCo."""

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs import start
from footfall.envs.actuation import Actuation
from footfall.envs.base import Base
from footfall.envs.commands import draw_command, draw_hold_steps
from footfall.envs.config import Curriculum, GaitConfig, PushConfig
from footfall.envs.critic import Truth, critic_observation
from footfall.envs.disturb import DISTURBANCE_NUMBERS, disturb, draw_push
from footfall.envs.feet import Feet
from footfall.envs.gait import make_gait
from footfall.envs.observe import Observer
from footfall.envs.physics.interface import Drive, Fields, Motion, Trace
from footfall.envs.start import Start
from footfall.envs.state import State, Step
from footfall.envs.velocity import VelocityEnv, make_contract
from footfall.policies.action import gait_reference
from footfall.policies.contract import Term
from footfall.policies.gaits import GaitPattern, find_gait
from footfall.robots.description import load_robot
from footfall.robots.model import training_model
from footfall.train.config import load_preset

ROBOT = load_robot("go1")
CONFIG = load_preset("smoke").env
MODEL = training_model(ROBOT, CONFIG.timestep_s)
YAW_90 = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
N = 12


@pytest.fixture(scope="module")
def env() -> VelocityEnv:
    return VelocityEnv(ROBOT, CONFIG)


@pytest.fixture(scope="module")
def begun(env: VelocityEnv) -> State:
    return jax.jit(env.reset)(jax.random.PRNGKey(0))[0]


def placed(
    state: State, place=(0.0, 0.0, 0.3), quaternion=(1.0, 0.0, 0.0, 0.0), velocity=(0.0,) * 6
) -> State:
    """A state with the base put here, moving like this in MuJoCo's own coordinates."""
    qpos = state.qpos.at[:3].set(jnp.asarray(place)).at[3:7].set(jnp.asarray(quaternion))
    return state._replace(qpos=qpos, qvel=state.qvel.at[:6].set(jnp.asarray(velocity)))


def trace(feet: np.ndarray, torque: float = 0.0) -> Trace:
    """What two physics steps left with the feet (2, feet, 3) here."""
    return Trace(
        jnp.zeros((2, 19)), jnp.zeros((2, 18)), jnp.asarray(feet, jnp.float32), jnp.full((2, N), torque)
    )


class TestBase:
    FORWARD_AT_90 = np.array([0.0, 0.7, 0.0, 0.1, 0.2, 0.3])  # along the world's y

    def test_a_robot_that_looks_left_and_moves_left_moves_forward(
        self, env: VelocityEnv, begun: State
    ) -> None:
        state = placed(begun, quaternion=YAW_90, velocity=self.FORWARD_AT_90)
        outcome = env.reward_inputs(state, trace(np.zeros((2, 4, 3))))
        np.testing.assert_allclose(outcome.linear_velocity, [0.7, 0.0, 0.0], atol=1e-6)
        np.testing.assert_allclose(outcome.angular_velocity, [0.1, 0.2, 0.3], atol=1e-6)

    def test_the_critic_is_told_so(self, env: VelocityEnv, begun: State) -> None:
        state = placed(begun, quaternion=YAW_90, velocity=self.FORWARD_AT_90, place=(0.0, 0.0, 0.25))
        observed, feet = jnp.zeros(env.observation_sizes["state"]), jnp.array([1.0, 0.0, 0.0, 1.0])
        peak = ROBOT.motor.peak_torque
        seen = env.observations(state, observed, feet, 0.01 * jnp.arange(4.0), jnp.asarray(0.5 * peak))
        told = np.asarray(seen["privileged_state"])[len(observed) + 3 + 3 + 3 + 12 + 12 + 12 + 2 :]
        velocity, height, contact, clearance, torque = np.split(told[:24], np.cumsum([3, 1, 4, 4]))
        np.testing.assert_allclose(velocity, [0.7, 0.0, 0.0], atol=1e-6)
        np.testing.assert_allclose(height, [0.25])
        np.testing.assert_allclose(contact, [1, 0, 0, 1])
        np.testing.assert_allclose(clearance, [0.0, 0.1, 0.2, 0.3], rtol=1e-6)  # in tenths of a metre
        np.testing.assert_allclose(torque, np.full(N, 0.5), rtol=1e-6)

    @pytest.mark.parametrize(
        ("tilt_rad", "height_m", "fell"),
        [(0.0, 0.3, 0.0), (1.05, 0.3, 0.0), (1.15, 0.3, 1.0), (3.1, 0.3, 1.0), (0.0, 0.1, 1.0)],
    )
    def test_a_fall_is_a_tilt_or_a_low_base(
        self, env: VelocityEnv, begun: State, tilt_rad: float, height_m: float, fell: float
    ) -> None:
        quaternion = (np.cos(tilt_rad / 2), np.sin(tilt_rad / 2), 0.0, 0.0)
        state = placed(begun, place=(0.0, 0.0, height_m), quaternion=quaternion)
        assert float(env.reward_inputs(state, trace(np.zeros((2, 4, 3)))).fell) == fell

    def test_it_is_found_behind_other_joints(self, tmp_path: Path) -> None:
        """A robot whose free joint is the second: a flag on a hinge stands before it in the file."""
        folder = tmp_path / "flagged"
        shutil.copytree(ROBOT.folder, folder)
        path = folder / ROBOT.description.model
        flag = (
            '<body name="flag" pos="5 5 1"><joint name="wind" axis="0 0 1"/><geom size=".1" mass="1"/></body>'
        )
        path.write_text(re.sub(r"(<worldbody>)", rf"\1{flag}", path.read_text(), count=1))
        robot = load_robot(str(folder))
        env = VelocityEnv(robot, replace(CONFIG, noise=Noise()))
        state, _ = jax.jit(env.reset)(jax.random.PRNGKey(1))
        data = mujoco.MjData(training_model(robot, env.timestep_s))
        assert data.qpos.shape == (20,)
        assert env.base.position(state.qpos)[2] == pytest.approx(robot.description.standing_height_m)
        assert np.linalg.norm(env.base.quaternion(state.qpos)) == pytest.approx(1.0)
        moved = np.asarray(env.base.pushed(jnp.zeros(19), jnp.arange(1.0, 7.0)))
        np.testing.assert_array_equal(moved[:7], [0, 1, 2, 3, 4, 5, 6])
        np.testing.assert_array_equal(env.base.angular_velocity(jnp.asarray(moved)), [4, 5, 6])


class TestFeet:
    def test_a_standing_robot_touches_the_ground_with_all_feet(self, env: VelocityEnv, begun: State) -> None:
        data = mujoco.MjData(MODEL)
        data.qpos[:7] = (0, 0, ROBOT.description.standing_height_m, 1, 0, 0, 0)
        data.qpos[7:] = ROBOT.default_pose
        mujoco.mj_forward(MODEL, data)
        feet = np.array([data.geom(foot.geoms[0]).xpos for foot in ROBOT.description.feet])
        radius = [MODEL.geom(foot.geoms[0]).size[0] for foot in ROBOT.description.feet]
        on_ground = feet - np.array([0, 0, 1]) * (feet[:, 2] - radius)[:, None]
        lifted = on_ground + np.array([[0, 0, 0.0], [0, 0, 0.001], [0, 0, 0.003], [0, 0, 0.05]])
        outcome = env.reward_inputs(begun, trace(np.stack([lifted, lifted])))
        np.testing.assert_allclose(outcome.clearance, [0.0, 0.001, 0.003, 0.05], atol=1e-6)
        np.testing.assert_array_equal(outcome.contact, [1.0, 1.0, 0.0, 0.0])
        assert np.abs(feet[:, 2] - radius).max() < 0.005  # the description's height is true

    def test_speed_is_horizontal_and_of_the_last_physics_step(self) -> None:
        feet = Feet(MODEL, ROBOT, timestep_s=0.005, gait=None)
        places = np.zeros((3, 4, 3))
        places[0] = 7.0
        places[2] = [[0.003, 0.004, 0.5], [0, 0, 0], [-0.01, 0, 0], [0, 0.02, 0]]
        np.testing.assert_allclose(feet.speed(jnp.asarray(places)), [1.0, 0.0, 2.0, 4.0], rtol=1e-5)

    def test_feet_crowd_where_two_are_nearer_than_they_should(self) -> None:
        feet = Feet(MODEL, ROBOT, timestep_s=0.005, gait=None)
        places = jnp.array([[0.0, 0.0, 0.5], [0.03, 0.04, 0.0], [1.0, 0.0, 0.0], [1.0, 0.09, 0.0]])
        assert float(feet.crowding(places, 0.1)) == pytest.approx(0.05**2 + 0.01**2, rel=1e-4)
        assert float(feet.crowding(places, 0.05)) == pytest.approx(0.0, abs=1e-9)

    @pytest.mark.parametrize("phase", np.linspace(0.0, 0.95, 20))
    def test_swing_follows_the_reference_gait(self, phase: float) -> None:
        contract = make_contract(ROBOT, CONFIG)
        assert contract.gait is not None
        reference = gait_reference(np.array([phase]), np.array([0.5, 0.0, 0.0]), contract)
        amplitude = np.array(contract.gait.amplitude_rad)
        share = (reference.reshape(4, 3) @ np.ones(3)) / (amplitude.reshape(4, 3) @ np.ones(3))
        feet = Feet(MODEL, ROBOT, CONFIG.timestep_s, find_gait("trot", ROBOT))
        swing = feet.planned_swing(jnp.array([phase], dtype=jnp.float32), jnp.float32(1.0))
        np.testing.assert_allclose(swing, share, atol=1e-5)

    def test_the_reference_lifts_each_foot_straight_up(self) -> None:
        gait = make_gait(ROBOT, GaitConfig("trot", reference_lift_m=0.05))
        data, feet = mujoco.MjData(MODEL), []
        for pose in (ROBOT.default_pose, ROBOT.default_pose + gait.amplitude_rad):
            data.qpos[7:] = pose
            mujoco.mj_kinematics(MODEL, data)
            feet.append([data.geom(foot.geoms[0]).xpos.copy() for foot in ROBOT.description.feet])
        np.testing.assert_allclose(np.subtract(feet[1], feet[0]), np.tile([0, 0, 0.05], (4, 1)), atol=1e-4)

    def test_a_foot_with_a_quarter_cycles_phase_is_a_quarter_cycle_ahead(self) -> None:
        crawl = GaitPattern(0.5, np.arange(4) / 4)
        swing = Feet(MODEL, ROBOT, 0.005, crawl).planned_swing(jnp.zeros(1), jnp.float32(1.0))
        np.testing.assert_allclose(swing, [0, 1, 0, 0], atol=1e-6)

    def test_without_a_gait_no_swing_is_planned(self) -> None:
        swing = Feet(MODEL, ROBOT, 0.005, None).planned_swing(jnp.full(1, 0.3), jnp.float32(1.0))
        np.testing.assert_array_equal(swing, np.zeros(4))

    def test_no_foot_swings_while_the_robot_is_asked_to_stand(self, env: VelocityEnv, begun: State) -> None:
        phase = jnp.array([0.25])
        still = begun._replace(phase=phase, command=jnp.array([0.05, 0.0, 0.0]))
        going = begun._replace(phase=phase, command=jnp.array([0.5, 0.0, 0.0]))
        feet = trace(np.zeros((2, 4, 3)))
        np.testing.assert_array_equal(env.reward_inputs(still, feet).swing, np.zeros(4))
        np.testing.assert_allclose(np.sort(env.reward_inputs(going, feet).swing), [0, 0, 1, 1], atol=1e-6)
        assert [float(env.reward_inputs(each, feet).moving) for each in (still, going)] == [0.0, 1.0]


class TestCommands:
    RANGES = CONFIG.commands.ranges

    def drawn(self, *u: float, **changes: float) -> np.ndarray:
        return np.asarray(draw_command(jnp.array(u), replace(CONFIG.commands, **changes)))

    def test_the_ranges_are_reached_axis_by_axis(self) -> None:
        low, high = self.drawn(0, 0, 0, 0, 1, 1), self.drawn(1, 1, 1, 0, 1, 1)
        ranges = (self.RANGES.forward_m_s, self.RANGES.leftward_m_s, self.RANGES.yaw_rad_s)
        np.testing.assert_allclose(np.stack([low, high], axis=1), ranges, rtol=1e-6)

    @pytest.mark.parametrize(("u", "axis"), [(0.0, 0), (0.3, 0), (0.34, 1), (0.6, 1), (0.67, 2), (0.99, 2)])
    def test_each_axis_is_commanded_alone_one_time_in_three(self, u: float, axis: int) -> None:
        command = self.drawn(1, 1, 1, u, 0.29, 1, single_axis_probability=0.3)
        assert np.flatnonzero(command).tolist() == [axis]
        assert np.all(self.drawn(1, 1, 1, u, 0.31, 1, single_axis_probability=0.3))

    def test_some_ask_to_stand(self) -> None:
        assert not self.drawn(1, 1, 1, 0, 1, 0.09, standing_probability=0.1).any()
        assert self.drawn(1, 1, 1, 0, 1, 0.11, standing_probability=0.1).any()

    def test_they_are_held_for_seconds(self) -> None:
        config = replace(CONFIG.commands, hold_s=Distribution(2.0, 4.0))
        assert [int(draw_hold_steps(jnp.float32(u), config, 50.0)) for u in (0.0, 0.5)] == [100, 150]


class TestDisturbances:
    U = jnp.linspace(0.05, 0.95, DISTURBANCE_NUMBERS)
    PUSHES = PushConfig(Distribution(2.0, 2.0), horizontal_m_s=1.0, vertical_m_s=0.4, angular_rad_s=0.8)
    BASE = Base(MODEL, ROBOT)

    def after(self, state: State, **changes: object) -> State:
        commands = replace(CONFIG.commands, standing_probability=0.0, single_axis_probability=0.0)
        config = replace(CONFIG, pushes=self.PUSHES, commands=commands, **changes)
        return disturb(state, self.U, config, self.BASE)

    def test_a_command_changes_after_its_hold_and_not_before(self, begun: State) -> None:
        state = begun._replace(hold_steps=jnp.int32(2), command=jnp.array([9.0, 9.0, 9.0]))
        commands = []
        for _ in range(4):
            state = self.after(state)
            commands.append(float(state.command[0]))
        assert commands[:2] == [9.0, 9.0]
        assert abs(commands[2]) < 9.0  # a fresh one, and the hold begins anew
        assert int(state.hold_steps) >= CONFIG.commands.hold_s.low * CONFIG.control_rate_hz - 2

    def test_a_push_comes_when_it_is_due_and_the_next_one_later(self, begun: State) -> None:
        waiting, due = (begun._replace(push_steps=jnp.int32(k)) for k in (1, 0))
        np.testing.assert_array_equal(self.after(waiting).qvel, waiting.qvel)
        assert int(self.after(waiting).push_steps) == 0
        pushed = self.after(due)
        assert np.all(np.asarray(pushed.qvel - due.qvel)[:6] != 0.0)  # along and about every axis
        np.testing.assert_array_equal(pushed.qvel[6:], due.qvel[6:])
        assert int(pushed.push_steps) == 2.0 * CONFIG.control_rate_hz

    @pytest.mark.parametrize(
        ("u", "expected"),
        [
            ([0.0, 1.0, 0.5, 0.5, 0.5, 0.5], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            ([0.25, 0.5, 0.5, 0.5, 0.5, 0.5], [0.0, 0.5, 0.0, 0.0, 0.0, 0.0]),
            ([0.5, 1.0, 1.0, 0.5, 0.5, 0.5], [-1.0, 0.0, 0.4, 0.0, 0.0, 0.0]),
            ([0.0, 0.0, 0.0, 1.0, 0.0, 0.75], [0.0, 0.0, -0.4, 0.8, -0.8, 0.4]),
        ],
    )
    def test_pushes_have_their_direction_and_strength(self, u: list[float], expected: list[float]) -> None:
        np.testing.assert_allclose(draw_push(jnp.array(u), self.PUSHES), expected, atol=1e-6)

    def test_the_curriculum_scales_them(self, begun: State) -> None:
        due = begun._replace(push_steps=jnp.int32(0), hold_steps=jnp.int32(0))
        easy, half, full = (
            self.after(due._replace(level=jnp.float32(level)), curriculum=Curriculum(1, 0.5, 0.0))
            for level in (0.0, 0.5, 1.0)
        )
        np.testing.assert_allclose(easy.command, 0.5 * full.command, rtol=1e-6)
        np.testing.assert_allclose(half.command, 0.75 * full.command, rtol=1e-6)
        np.testing.assert_array_equal(easy.qvel, due.qvel)
        np.testing.assert_allclose(half.qvel - due.qvel, 0.5 * (full.qvel - due.qvel), atol=1e-6)


class TestStart:
    def draw(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        qpos, qvel = Start(MODEL, ROBOT, CONFIG.initial).draw(jnp.asarray(u, dtype=jnp.float32))
        return np.asarray(qpos), np.asarray(qvel)

    def test_in_the_middle_it_is_the_default_pose_at_rest(self) -> None:
        qpos, qvel = self.draw(np.full(31, 0.5))
        expected = [0, 0, ROBOT.description.standing_height_m, 1, 0, 0, 0, *ROBOT.default_pose]
        np.testing.assert_allclose(qpos, expected, atol=1e-6)
        np.testing.assert_array_equal(qvel, np.zeros(18))

    def test_it_stands_on_the_ground_wherever_that_is(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Half a metre up where x is 0, and sloping."""
        monkeypatch.setattr(start, "ground_height", lambda place: 0.5 + 0.1 * place[0])
        qpos, _ = self.draw(np.full(31, 0.5))
        assert qpos[2] == pytest.approx(0.5 + ROBOT.description.standing_height_m)

    def test_each_number_moves_its_own_part(self) -> None:
        initial = CONFIG.initial
        u = np.full(31, 0.5)
        u[0], u[3], u[4], u[5], u[7], u[30] = 0.75, 1.0, 0.0, 1.0, 1.0, 0.0
        qpos, qvel = self.draw(u)
        np.testing.assert_allclose(qpos[3:7], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)], atol=1e-6)  # a quarter turn
        assert qpos[7] - ROBOT.default_pose[0] == pytest.approx(initial.joint_rad, rel=1e-5)
        expected = np.zeros(18)
        expected[[0, 1]] = initial.velocity_m_s, -initial.velocity_m_s
        expected[[5, 17]] = initial.yaw_rate_rad_s, -initial.joint_velocity_rad_s
        np.testing.assert_allclose(qvel, expected, rtol=1e-6)

    def test_tilt_is_about_the_bodys_own_axes(self) -> None:
        u = np.full(31, 0.5)
        u[0], u[1] = 0.75, 1.0
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, self.draw(u)[0][3:7].astype(float))
        gravity = rotation.reshape(3, 3).T @ [0, 0, -1]
        assert np.arctan2(-gravity[1], -gravity[2]) == pytest.approx(CONFIG.initial.tilt_rad, rel=1e-2)
        assert gravity[0] == pytest.approx(0.0, abs=1e-6)


class TestObserver:
    TERMS = (Term("gyro"), Term("gravity"), Term("joint_position"), Term("joint_velocity"))

    def make(self, noise: Noise, **biases: float) -> tuple[Observer, VelocityEnv]:
        ranges = {name: Distribution(value, value) for name, value in biases.items()}
        config = replace(CONFIG, observation=self.TERMS, noise=noise, randomisation=Randomisation(**ranges))
        env = VelocityEnv(ROBOT, config)
        return env.observer, env

    def test_readings_are_mujocos(self) -> None:
        data = mujoco.MjData(MODEL)
        data.qpos[3:7] = np.array([0.9, 0.1, -0.3, 0.2]) / np.linalg.norm([0.9, 0.1, -0.3, 0.2])
        data.qpos[7:] = np.linspace(-0.5, 0.5, N)
        data.qvel[:] = np.linspace(-1, 1, 18)
        mujoco.mj_forward(MODEL, data)
        gravity = data.body(ROBOT.description.base).xmat.reshape(3, 3).T @ [0, 0, -1]
        observer = Observer(MODEL, ROBOT, CONFIG, make_contract(ROBOT, CONFIG))
        read = observer.readings(jnp.asarray(data.qpos), jnp.asarray(data.qvel), jnp.zeros(N))
        expected = [*data.qvel[3:6], *gravity, *data.qpos[7:], *data.qvel[6:]]
        np.testing.assert_allclose(read, expected, atol=1e-6)

    def test_noise_comes_after_bias_and_gravity_is_a_unit_vector_before_and_after(self) -> None:
        """A bias of 0.75 on (0, 0, -1) is the direction of (3, 3, -1); noise shifts that, not the raw one."""
        observer, env = self.make(Noise(gravity=0.1, gyro=0.5), gravity_bias=0.75, gyro_bias=0.2)
        state, _ = env.reset(jax.random.PRNGKey(0))
        level = jnp.concatenate([jnp.zeros(5), jnp.array([-1.0]), jnp.zeros(24)])
        u = jnp.full(observer.numbers, 0.5).at[:6].set(jnp.array([1.0, 0.5, 0.0, 1.0, 0.5, 0.5]))
        _, seen = observer.observe(state, jnp.tile(level, (8, 1)), u)
        np.testing.assert_allclose(seen[:3], [0.7, 0.2, -0.3], atol=1e-6)
        tilted = np.array([0.75, 0.75, -0.25]) / np.linalg.norm([0.75, 0.75, -0.25])
        noisy = tilted + np.array([0.1, 0.0, 0.0])
        np.testing.assert_allclose(seen[3:6], noisy / np.linalg.norm(noisy), atol=1e-6)

    def test_noise_of_positions_and_velocities_is_drawn_apart(self) -> None:
        observer, env = self.make(Noise(joint_position=0.1, joint_velocity=0.1))
        state, _ = env.reset(jax.random.PRNGKey(0))
        u = jax.random.uniform(jax.random.PRNGKey(1), (4000, observer.numbers))
        seen = jax.vmap(lambda each: observer.observe(state, jnp.zeros((8, 30)), each)[1])(u)
        correlation = np.corrcoef(np.asarray(seen)[:, [*range(6, 18), *range(18, 30)]].T)
        assert np.abs(correlation - np.eye(24)).max() < 0.1

    def test_the_observation_is_as_old_as_its_delay(self) -> None:
        observer, env = self.make(Noise(), observation_delay_s=1.5 * CONFIG.timestep_s)
        state, _ = env.reset(jax.random.PRNGKey(0))
        recent = jnp.arange(8.0)[:, None] * jnp.ones(30)
        _, seen = observer.observe(state, recent, jnp.full(30, 0.5))
        np.testing.assert_allclose(seen[:3], np.full(3, 5.5), rtol=1e-6)

    def test_the_last_action_is_the_newest_for_actor_and_critic(self, begun: State) -> None:
        config = replace(CONFIG, observation=(Term("last_action"), Term("command")))
        observer = Observer(MODEL, ROBOT, config, make_contract(ROBOT, config))
        actions = jnp.array([[1.0], [2.0], [3.0]]) * jnp.ones(N)
        state = begun._replace(actions=actions, frames=observer.no_frames())
        expected = [*np.ones(N), *np.asarray(state.command)]
        _, seen = observer.observe(state, jnp.zeros((8, 30)), jnp.full(30, 0.5))
        np.testing.assert_array_equal(seen, np.float32(expected))
        np.testing.assert_array_equal(observer.clean_frame(state, jnp.zeros(N)), np.float32(expected))

    def test_an_episode_begins_with_its_first_frame_as_the_whole_history(self) -> None:
        config = replace(CONFIG, observation=(Term("gyro", 1.0, 3),), noise=Noise())
        env = VelocityEnv(ROBOT, config)
        state, first = env.reset(jax.random.PRNGKey(0))
        np.testing.assert_array_equal(first["state"][:3], first["state"][6:])
        turning = jnp.zeros((8, 30)).at[:, :3].set(7.0)
        _, then = env.observer.observe(state, turning, jnp.full(30, 0.5))
        np.testing.assert_array_equal(then, [*first["state"][3:], 7.0, 7.0, 7.0])


class TestActuation:
    def test_targets_stay_within_the_soft_limits_and_the_rate(self) -> None:
        actuation = Actuation(ROBOT, CONFIG)
        default = jnp.asarray(ROBOT.default_pose, dtype=jnp.float32)
        far = jnp.tile(default + 100.0, (3, 1))
        targets = np.asarray(actuation.targets(far, default, {}))
        step = ROBOT.description.target_rate_rad_s * CONFIG.timestep_s
        expected = np.minimum(ROBOT.default_pose + step, ROBOT.soft_limits[1])
        np.testing.assert_allclose(targets[0], expected, rtol=1e-5)
        near = jnp.asarray(ROBOT.soft_limits[1] - 1.5 * step, dtype=jnp.float32)
        targets = np.asarray(actuation.targets(far, near, {}))
        np.testing.assert_allclose(targets[-1], ROBOT.soft_limits[1], rtol=1e-5)

    def test_the_sampled_motors_get_their_own_gains_strength_and_bias(self) -> None:
        sample = {"kp": jnp.full(N, 1.1), "kd": jnp.full(N, 0.8), "motor_strength": jnp.full(N, 0.9)}
        actuation = Actuation(ROBOT, CONFIG)
        drive = actuation.drive(jnp.zeros((4, N)), sample | {"encoder_bias": jnp.full(N, 0.02)})
        np.testing.assert_allclose(drive.kp, 1.1 * ROBOT.kp, rtol=1e-6)
        np.testing.assert_allclose(drive.kd, 0.8 * ROBOT.kd, rtol=1e-6)
        np.testing.assert_allclose(drive.motor.strength, 0.9 * ROBOT.motor.strength, rtol=1e-6)
        np.testing.assert_allclose(drive.encoder_bias, np.full(N, 0.02), rtol=1e-6)
        np.testing.assert_array_equal(actuation.drive(jnp.zeros((4, N)), {}).encoder_bias, np.zeros(N))


class TestStep:
    """What a step does around the physics, with a physics in which nothing moves."""

    @pytest.fixture(scope="class")
    @classmethod
    def still(cls) -> VelocityEnv:
        gait = replace(CONFIG.gait or GaitConfig("trot"), frequency_hz=2.0)
        pushes = replace(CONFIG.pushes, horizontal_m_s=0.0, vertical_m_s=0.0, angular_rad_s=0.0)
        env = VelocityEnv(ROBOT, replace(CONFIG, gait=gait, pushes=pushes, episode_s=0.1, speed_limit=50.0))

        def nothing_moves(motion: Motion, drive: Drive, _: Fields) -> tuple[Motion, Trace]:
            count = CONFIG.substeps
            feet = jnp.zeros((count, 4, 3))
            torque = jnp.zeros((count, N))
            return motion, Trace(*(jnp.tile(x, (count, 1)) for x in motion[:2]), feet, torque)

        env.engine = env.engine._replace(simulate=nothing_moves)
        return env

    @pytest.fixture(scope="class")
    @classmethod
    def step(cls, still: VelocityEnv) -> Callable[..., tuple[State, Step]]:
        return jax.jit(still.step)

    @pytest.fixture(scope="class")
    @classmethod
    def state(cls, still: VelocityEnv) -> State:
        return placed(jax.jit(still.reset)(jax.random.PRNGKey(2))[0])

    def test_the_clock_goes_on_by_the_control_period(self, step, state: State) -> None:
        after, _ = step(state._replace(phase=jnp.array([0.97])), jnp.zeros(N))
        np.testing.assert_allclose(after.phase, [0.01], atol=1e-6)  # 0.97 + 2 Hz / 50 Hz, wrapped

    def test_the_last_three_actions_are_kept_newest_first(self, step, state: State) -> None:
        for k in (1.0, 2.0, 3.0, 4.0):
            state, _ = step(state, jnp.full(N, k))
        np.testing.assert_array_equal(state.actions[:, 0], [4.0, 3.0, 2.0])

    def test_an_episode_of_a_tenth_of_a_second_has_five_steps(self, step, state: State) -> None:
        ends = []
        for _ in range(5):
            state, result = step(state, jnp.zeros(N))
            ends.append((float(result.terminated), float(result.truncated)))
        assert ends == [(0.0, 0.0)] * 4 + [(0.0, 1.0)]

    def test_a_fall_terminates_and_is_no_time_out(self, step, state: State) -> None:
        fallen = placed(state, quaternion=(0.0, 1.0, 0.0, 0.0))._replace(steps=jnp.int32(4))
        _, result = step(fallen, jnp.zeros(N))
        assert (float(result.terminated), float(result.truncated)) == (1.0, 0.0)

    @pytest.mark.parametrize(("speed", "diverged"), [(49.0, 0.0), (51.0, 1.0), (-51.0, 1.0)])
    def test_excessive_finite_speed_is_a_divergence(
        self, step, state: State, speed: float, diverged: float
    ) -> None:
        fast = state._replace(qvel=state.qvel.at[17].set(speed))
        _, result = step(fast, jnp.zeros(N))
        assert float(result.metrics["episode/diverged"]) == float(result.terminated) == diverged

    def test_every_step_has_random_numbers_of_its_own(self, step, state: State) -> None:
        one, first = step(state, jnp.zeros(N))
        _, second = step(one._replace(frames=state.frames, phase=state.phase), jnp.zeros(N))
        assert not np.array_equal(one.key, state.key)
        assert not np.array_equal(first.observation["state"][:3], second.observation["state"][:3])  # gyro

    def test_the_readings_of_this_step_are_there_in_the_next(self, still, step, state: State) -> None:
        turned = placed(state, velocity=(0, 0, 0, 0.5, 0.6, 0.7))
        after, _ = step(turned, jnp.zeros(N))
        expected = still.observer.readings(turned.qpos, turned.qvel, jnp.zeros(N))
        np.testing.assert_allclose(after.recent_readings, np.tile(expected, (CONFIG.substeps, 1)), atol=1e-6)

    def test_the_next_step_goes_on_from_the_last_target(self, step, state: State) -> None:
        """A far goal is approached at 60 rad/s through all physics steps of 20 ms, to the soft limit."""
        at_once = state._replace(sample=state.sample | {"action_delay_s": jnp.float32(0.0)})
        after, _ = step(at_once, jnp.full(N, 100.0))
        assert ROBOT.description.target_rate_rad_s == 60.0
        np.testing.assert_allclose(
            after.target, np.minimum(ROBOT.default_pose + 1.2, ROBOT.soft_limits[1]), rtol=1e-5
        )

    def test_the_reward_is_the_weighted_rate_times_the_control_period(self, step, state: State) -> None:
        command = jnp.array([0.5, 0.0, 0.3])
        at_speed = placed(state, velocity=(0.5, 0, 0, 0, 0, 0.3))._replace(command=command)
        _, result = step(at_speed, jnp.zeros(N))
        weights = CONFIG.rewards  # it tracks perfectly, stands upright and does not change its action
        best = weights["track_linear"] + weights["track_yaw"] + weights["alive"]
        assert float(result.reward) == pytest.approx(best / CONFIG.control_rate_hz, rel=1e-5)
        assert float(result.metrics["tracking/linear_error_m_s"]) == pytest.approx(0.0, abs=1e-6)
        slow = at_speed._replace(command=jnp.array([0.8, 0.4, 0.1]))
        metrics = step(slow, jnp.zeros(N))[1].metrics
        assert float(metrics["tracking/linear_error_m_s"]) == pytest.approx(0.5, rel=1e-5)
        assert float(metrics["tracking/yaw_error_rad_s"]) == pytest.approx(0.2, rel=1e-5)


def test_the_critics_layout_does_not_depend_on_the_order_of_a_dictionary(env: VelocityEnv) -> None:
    """JAX sorts a dictionary's keys wherever it hands one back."""
    truth = Truth(jnp.zeros(3), jnp.zeros(()), jnp.zeros(4), jnp.zeros(4), jnp.zeros(N))
    sample = {"friction": jnp.float32(0.7), "kp": jnp.full(N, 1.1), "battery": jnp.float32(0.9)}
    backwards = dict(reversed(sample.items()))
    seen = [critic_observation(jnp.zeros(2), jnp.zeros(2), truth, each) for each in (sample, backwards)]
    np.testing.assert_array_equal(*seen)
    np.testing.assert_allclose(seen[0][-14:], [0.7, *np.full(N, 1.1), 0.9], rtol=1e-6)

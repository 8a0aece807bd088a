"""Commands and events: how they are drawn, when they come, what they change; curricula scale them."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from go1_smoke import MODEL, ROBOT, SCENE, SMOKE
from scipy.spatial.transform import Rotation

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.noise import Noise
from footfall.envs.config import CurriculumConfig, EventConfig, ObservationConfig
from footfall.envs.disturb import Disturbances
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.physics.interface import GRAVITY
from footfall.envs.state import State
from footfall.envs.task import Task
from footfall.envs.terms import data
from footfall.envs.terms.commands import velocity
from footfall.envs.terms.data import Scene
from footfall.envs.terms.events import Occasion, drop, gravity, push, reset_pose, slope
from footfall.robots.kinds import Parts

STRONG = {"horizontal_m_s": 1.0, "vertical_m_s": 0.4, "angular_rad_s": 0.8}


@pytest.fixture(scope="module")
def begun() -> State:
    return jax.jit(LocomotionEnv(ROBOT, SMOKE).reset)(jax.random.PRNGKey(0))[0]


def test_commands_are_drawn_by_axis_with_shares_of_single_axes_and_of_standing() -> None:
    def drawn(*u: float, **changes: float) -> np.ndarray:
        return np.asarray(velocity.draw(jnp.array(u), replace(SMOKE.commands, **changes)))

    low, high, ranges = drawn(0, 0, 0, 0, 1, 1), drawn(1, 1, 1, 0, 1, 1), SMOKE.commands.ranges
    expected = (ranges.forward_m_s, ranges.leftward_m_s, ranges.yaw_rad_s)
    np.testing.assert_allclose(np.stack([low, high], axis=1), expected, rtol=1e-6)
    for u, axis in ((0.0, 0), (0.3, 0), (0.34, 1), (0.6, 1), (0.67, 2), (0.99, 2)):
        assert np.flatnonzero(drawn(1, 1, 1, u, 0.29, 1, single_axis_probability=0.3)).tolist() == [axis]
        assert np.all(drawn(1, 1, 1, u, 0.31, 1, single_axis_probability=0.3))
    assert not drawn(1, 1, 1, 0, 1, 0.09, standing_probability=0.1).any()
    assert drawn(1, 1, 1, 0, 1, 0.11, standing_probability=0.1).any()


class TestPush:
    def after(self, state: State, **changes: object) -> State:
        """The state after a step with pushes and commands of all axes."""
        commands = replace(SMOKE.commands, standing_probability=0.0, single_axis_probability=0.0)
        due = EventConfig("push", interval_s=Distribution(2.0, 2.0), settings=STRONG)
        config = replace(SMOKE, events=(due,), commands=commands, **changes)
        made = Disturbances(Task(config, SCENE), config, SCENE)
        return made.step(state, jnp.linspace(0.05, 0.95, made.step_numbers))

    def test_pushes_are_as_drawn(self, begun: State) -> None:
        still = begun._replace(qvel=jnp.zeros(18))
        for u, expected in (
            ([0.0, 1.0, 0.5, 0.5, 0.5, 0.5], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            ([0.25, 0.5, 0.5, 0.5, 0.5, 0.5], [0.0, 0.5, 0.0, 0.0, 0.0, 0.0]),
            ([0.5, 1.0, 1.0, 0.5, 0.5, 0.5], [-1.0, 0.0, 0.4, 0.0, 0.0, 0.0]),
            ([0.0, 0.0, 0.0, 1.0, 0.0, 0.75], [0.0, 0.0, -0.4, 0.8, -0.8, 0.4]),
        ):
            pushed = push.change(still, Occasion(SCENE, True, jnp.array(u), 1.0), **STRONG)
            np.testing.assert_allclose(pushed.qvel[:6], expected, atol=1e-6)

    def test_the_curriculum_scales_commands_and_pushes(self, begun: State) -> None:
        starts = {"commands": 0.5, "push": 0.0}
        curricula = tuple(CurriculumConfig("linear", of, settings={"start": s}) for of, s in starts.items())
        due = begun._replace(event_steps={"push": jnp.int32(0)}, hold_steps=jnp.int32(0))
        levels = (due._replace(level=jnp.float32(level)) for level in (0.0, 0.5, 1.0))
        easy, half, full = (self.after(state, curricula=curricula) for state in levels)
        np.testing.assert_allclose(easy.command, 0.5 * full.command, rtol=1e-6)
        np.testing.assert_allclose(half.command, 0.75 * full.command, rtol=1e-6)
        np.testing.assert_array_equal(easy.qvel, due.qvel)
        np.testing.assert_allclose(half.qvel - due.qvel, 0.5 * (full.qvel - due.qvel), atol=1e-6)

    def test_only_due_commands_and_events_change(self, begun: State) -> None:
        for hold, shove in ((0, 5), (5, 0), (-1, -1)):
            steps = {"push": jnp.int32(shove)}
            after = self.after(begun._replace(hold_steps=jnp.int32(hold), event_steps=steps))
            assert np.array_equal(after.command, begun.command) == (hold > 0)
            assert np.array_equal(after.qvel, begun.qvel) == (shove > 0)
            assert (int(after.hold_steps) == hold - 1) == (hold > 0)
            assert (int(after.event_steps["push"]) == shove - 1) == (shove > 0)


class TestResetPose:
    def draw(self, begun: State, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities that these random numbers give."""
        spread = {"joint_rad": 0.11, "tilt_rad": 0.12, "velocity_m_s": 0.13, "yaw_rate_rad_s": 0.14}
        spread["joint_velocity_rad_s"] = 0.15
        scene = Scene(MODEL, ROBOT, SCENE.feet, 0.02)  # a new scene: the ground may have changed
        rest = begun._replace(qpos=jnp.asarray(scene.standing), qvel=jnp.zeros(18))
        state = reset_pose.change(rest, Occasion(scene, True, jnp.asarray(u, jnp.float32), 1.0), **spread)
        return np.asarray(state.qpos), np.asarray(state.qvel)

    def test_a_robot_stands_on_any_ground(self, begun: State, monkeypatch: pytest.MonkeyPatch) -> None:
        """The ground is half a metre high where x is 0, and slopes."""
        monkeypatch.setattr(data, "ground_height", lambda position: 0.5 + 0.1 * position[0])
        qpos, _ = self.draw(begun, np.full(31, 0.5))
        assert qpos[2] == pytest.approx(0.5 + ROBOT.description.standing_height_m)

    def test_each_random_number_changes_one_quantity(self, begun: State) -> None:
        assert reset_pose.numbers(Parts(12)) == 31
        u = np.random.default_rng(4).random(31)
        w, (qpos, qvel) = 2 * u - 1, self.draw(begun, u)
        tilt = Rotation.from_quat([0.06 * w[1], 0.06 * w[2], 0.0, 1.0])
        attitude = Rotation.from_euler("z", np.pi * w[0]) * tilt
        found = Rotation.from_quat(qpos[3:7], scalar_first=True)
        np.testing.assert_allclose(found.as_matrix(), attitude.as_matrix(), atol=1e-5)
        np.testing.assert_allclose(qpos[:3], [0.0, 0.0, ROBOT.description.standing_height_m])
        np.testing.assert_allclose(qpos[7:], ROBOT.default_pose + 0.11 * w[7:19], atol=1e-6)
        expected = [*(0.13 * w[3:5]), 0, 0, 0, 0.14 * w[5], *(0.15 * w[19:])]
        np.testing.assert_allclose(qvel, expected, atol=1e-6)


class TestSlope:
    def test_gravity_keeps_its_size_on_a_slope_and_its_slope_under_a_curriculum(self, begun: State) -> None:
        occasion, level = Occasion(SCENE, True, jnp.array([0.5, 0.25]), 1.0), np.array([0.0, 0.0, -9.81])
        sloped, tilted = slope.change(begun, occasion, up_to_rad=0.4), [0.0, np.sin(0.2), -np.cos(0.2)]
        np.testing.assert_allclose(sloped.fields[GRAVITY], 9.81 * np.array(tilted), atol=1e-5)
        for state, full in ((begun, level), (sloped, sloped.fields[GRAVITY])):
            found = gravity.change(state, Occasion(SCENE, True, jnp.zeros(0), 0.3)).fields[GRAVITY]
            np.testing.assert_allclose(found, 0.3 * full, atol=1e-5)

    def test_sensors_refer_to_gravity(self) -> None:
        """A robot whose base is parallel to the ground measures the slope."""
        events = (EventConfig("reset_pose", settings={"tilt_rad": 0.0}), EventConfig("slope"))
        observation = (ObservationConfig("gravity"),)
        env = LocomotionEnv(ROBOT, replace(SMOKE, events=events, observation=observation, noise=Noise()))
        state, seen = jax.jit(env.reset)(jax.random.PRNGKey(3))
        attitude = Rotation.from_quat(np.asarray(state.qpos[3:7]), scalar_first=True)
        down = attitude.inv().apply(state.fields[GRAVITY])
        np.testing.assert_allclose(seen["state"], down / 9.81, atol=1e-5)
        assert np.hypot(*seen["state"][:2]) > 0.02


def test_a_drop_begins_above_the_ground_in_any_attitude_inside_the_limits(begun: State) -> None:
    def dropped(u: jax.Array) -> State:
        return drop.change(begun, Occasion(SCENE, True, u, 1.0), lowest_m=0.1, highest_m=0.2)

    drawn = np.random.default_rng(0).random((40, drop.numbers(Parts(12))))
    state = jax.jit(jax.vmap(dropped))(jnp.asarray(drawn, jnp.float32))
    qpos, (lower, upper) = np.asarray(state.qpos), ROBOT.soft_limits
    assert np.all((lower - 1e-5 <= qpos[:, 7:]) & (qpos[:, 7:] <= upper + 1e-5))
    np.testing.assert_array_equal(state.goals, np.tile(qpos[:, None, 7:], (1, 3, 1)))
    points = np.asarray(jax.jit(jax.vmap(SCENE.body.points))(state.qpos))
    heights = (points[..., 2] - SCENE.body.radius).min(axis=1)
    upright = Rotation.from_quat(qpos[:, 3:7], scalar_first=True).as_matrix()[:, 2, 2]
    assert 0.1 - 1e-5 <= min(heights) < 0.13
    assert 0.17 < max(heights) <= 0.2 + 1e-5
    assert min(upright) < -0.7 < 0.7 < max(upright)

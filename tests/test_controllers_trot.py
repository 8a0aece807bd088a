"""What the trot and the stand command in single moments."""

from dataclasses import replace

import numpy as np
import pytest

from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stance import tilt_correction
from footfall.policies.controllers.stand import Stand
from footfall.policies.controllers.trot import Trot, TrotConfig
from footfall.policies.policy import Observation, Sensed
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
LEGS = ROBOT.legs
CONFIG = controller_settings(ROBOT, "trot", TrotConfig)
FORWARD = (0.4, 0.0, 0.0)


def seen(
    time_s: float = 0.0,
    command: tuple[float, float, float] = (0.0, 0.0, 0.0),
    roll: float = 0.0,
    pitch: float = 0.0,
    gyro: tuple[float, float, float] = (0.0, 0.0, 0.0),
    joint: np.ndarray = ROBOT.default_pose,
) -> Observation:
    """A small tilt about one axis, legs in the default pose unless said otherwise."""
    quaternion = np.array([np.cos((roll + pitch) / 2), np.sin(roll / 2), np.sin(pitch / 2), 0.0])
    zero = np.zeros(12)
    sensed = Sensed(np.array(gyro), np.array([0.0, 0.0, 9.81]), quaternion, joint, zero, zero)
    return Observation(time_s, sensed, np.array(command), np.zeros(3), 0.28)


class TestTilt:
    """Roll and pitch by which the feet turn with the base."""

    def test_it_is_a_share_of_the_measured_tilt(self) -> None:
        np.testing.assert_allclose(tilt_correction(seen(roll=0.1), 0.3, 0.0, 1.0), [0.03, 0.0], atol=1e-4)
        np.testing.assert_allclose(tilt_correction(seen(pitch=0.1), 0.3, 0.0, 1.0), [0.0, 0.03], atol=1e-4)

    def test_a_base_that_is_tilting_is_met_ahead(self) -> None:
        moving = seen(gyro=(0.5, -1.0, 7.0))
        np.testing.assert_allclose(tilt_correction(moving, 0.3, 0.02, 1.0), [0.01, -0.02])

    def test_it_is_bounded(self) -> None:
        wild = seen(gyro=(50.0, -50.0, 0.0))
        np.testing.assert_allclose(tilt_correction(wild, 0.3, 0.02, 0.2), [0.2, -0.2])


def feet_of(command_position: np.ndarray) -> np.ndarray:
    return LEGS.pose(command_position).foot


class TestStand:
    def test_it_begins_where_it_finds_the_legs(self) -> None:
        bent = ROBOT.default_pose + 0.05
        policy = Stand(ROBOT)
        policy.reset(seen(joint=bent))
        np.testing.assert_allclose(policy.act(seen(0.0, joint=bent)).position, bent)
        np.testing.assert_allclose(policy.act(seen(9.0, joint=bent)).position, ROBOT.default_pose, atol=1e-9)

    def test_tilted_to_the_right_it_pushes_down_on_the_right(self) -> None:
        policy = Stand(ROBOT)
        policy.reset(seen())
        feet = feet_of(policy.act(seen(9.0, roll=0.1)).position)
        right, left = feet[[0, 2], 2], feet[[1, 3], 2]
        assert np.all(right < left)


def walking(policy: Trot, command: tuple[float, float, float] = FORWARD, seconds: float = 1.0) -> np.ndarray:
    """Walk from a settled stance and return commanded feet, (ticks, legs, 3)."""
    policy.reset(seen())
    dt_s, start = 1 / policy.rate_hz, CONFIG.settle_s
    ticks = round(seconds * policy.rate_hz)
    return np.array([feet_of(policy.act(seen(start + k * dt_s, command)).position) for k in range(ticks)])


class TestTrot:
    def test_feet_on_the_ground_go_back_as_fast_as_the_base_goes_forward(self) -> None:
        feet = walking(Trot(ROBOT))
        speed = np.diff(feet, axis=0)[-200:] * CONFIG.rate_hz  # one period of 0.4 s
        grounded = np.abs(feet[-200:, :, 2] - feet[:, :, 2].min()) < 1e-6
        grounded &= np.roll(grounded, 1, axis=0)
        np.testing.assert_allclose(speed[:, :, 0][grounded].mean(), -0.4, atol=0.02)

    def test_turning_left_right_feet_go_back_and_left_feet_forward(self) -> None:
        """Of feet in their place: w x r."""
        policy = Trot(ROBOT)
        walking(policy, (0.0, 0.0, 0.5))
        expected = np.cross([0.0, 0.0, 0.5], policy._place)
        np.testing.assert_allclose(policy._foot_velocity(), expected, atol=1e-9)
        assert np.all(expected[[0, 2], 0] > 0)  # the base passes forward over right feet

    def test_feet_are_lifted_to_the_swing_height(self) -> None:
        feet = walking(Trot(ROBOT))
        np.testing.assert_allclose(np.ptp(feet[-200:, :, 2], axis=0), CONFIG.swing_height_m, rtol=0.01)

    def test_steps_are_bounded(self) -> None:
        short = replace(CONFIG, most_step_m=0.02)
        feet = walking(Trot(ROBOT, short), (1.0, 0.0, 0.0))
        np.testing.assert_allclose(np.ptp(feet[-200:, :, 0], axis=0), 0.04, rtol=0.02)

    def test_legs_that_stand_press_with_the_weight(self) -> None:
        """torque = -J' f for f upwards on the foot, an even share of the weight each."""
        policy = Trot(ROBOT)
        policy.reset(seen())
        torque = LEGS.gather(policy.act(seen(CONFIG.settle_s)).torque)
        force = -np.linalg.solve(
            LEGS.pose(ROBOT.default_pose).jacobian.transpose(0, 2, 1), torque[:, :, None]
        )[:, :, 0]
        np.testing.assert_allclose(force, np.tile([0.0, 0.0, CONFIG.weight_n / 4], (4, 1)), atol=1e-9)

    def test_a_new_episode_starts_without_a_jump_in_velocity(self) -> None:
        policy = Trot(ROBOT)
        walking(policy)
        policy.reset(seen())
        assert np.abs(policy.act(seen(0.0)).velocity).max() == pytest.approx(0.0, abs=1e-9)

    def test_a_second_episode_is_the_first_to_the_bit(self) -> None:
        policy = Trot(ROBOT)
        np.testing.assert_array_equal(walking(policy), walking(policy))

    def test_a_new_episode_forgets_the_tilt_of_the_last(self) -> None:
        policy = Trot(ROBOT)
        policy.reset(seen())
        policy.act(seen(CONFIG.settle_s, roll=0.2))
        positions = []
        for each in (policy, Trot(ROBOT)):
            each.reset(seen())
            positions.append(each.act(seen(CONFIG.settle_s)).position)
        np.testing.assert_array_equal(*positions)

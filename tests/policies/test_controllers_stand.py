"""What the stand commands in single moments."""

from dataclasses import replace

import numpy as np
import pytest

from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stance import tilt_correction
from footfall.policies.controllers.stand import Stand, StandConfig
from footfall.policies.policy import PolicyInput, Sensed
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
LEGS = ROBOT.legs


def seen(
    time_s: float = 0.0,
    command: tuple[float, float, float] = (0.0, 0.0, 0.0),
    roll: float = 0.0,
    pitch: float = 0.0,
    gyro: tuple[float, float, float] = (0.0, 0.0, 0.0),
    joint: np.ndarray = ROBOT.default_pose,
) -> PolicyInput:
    """A small tilt about one axis, legs in the default pose unless said otherwise."""
    quaternion = np.array([np.cos((roll + pitch) / 2), np.sin(roll / 2), np.sin(pitch / 2), 0.0])
    zero = np.zeros(12)
    sensed = Sensed(np.array(gyro), np.array([0.0, 0.0, 9.81]), quaternion, joint, zero, zero)
    return PolicyInput(time_s, sensed, np.array(command), np.zeros(3), 0.28)


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

    def test_before_any_reset_it_holds_the_default_pose(self) -> None:
        np.testing.assert_allclose(Stand(ROBOT).act(seen(0.0)).position, ROBOT.default_pose, atol=1e-9)

    def test_tilted_to_the_right_it_pushes_down_on_the_right(self) -> None:
        policy = Stand(ROBOT)
        policy.reset(seen())
        feet = feet_of(policy.act(seen(9.0, roll=0.1)).position)
        right, left = feet[[0, 2], 2], feet[[1, 3], 2]
        assert np.all(right < left)


ABOVE_ZERO = ("rate_hz", "kp", "settle_s")
NOT_BELOW = ("kd", "tilt_gain", "tilt_rate_gain_s", "most_tilt_rad")
BAD = [(name, 0.0, "above 0") for name in ABOVE_ZERO] + [(name, -0.1, "0 or above") for name in NOT_BELOW]


@pytest.mark.parametrize(("name", "value", "rule"), BAD)
def test_settings_that_cannot_work_are_refused(name: str, value: float, rule: str) -> None:
    fine = controller_settings(ROBOT, "stand", StandConfig)
    with pytest.raises(ValueError, match=f"{name} must be {rule}"):
        replace(fine, **{name: value})
    if rule == "0 or above":
        replace(fine, **{name: 0.0})

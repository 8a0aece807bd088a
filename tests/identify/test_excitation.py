"""The excitation of robots on a stand."""

from typing import NamedTuple

import numpy as np
import pytest
from moments import readings
from scipy.spatial.transform import Rotation

from footfall.identify.excitation import Excitation, ExcitationConfig, swing_senses
from footfall.policies.policy import PolicyInput
from footfall.robots.description import Robot, load_robot

RATE_HZ = 50.0


class Targets(NamedTuple):
    away: np.ndarray  # (T, n) rad, from the default pose
    chirp: np.ndarray  # (T,) 0 and 1 in the two chirps, less or more outside


def targets(robot: Robot) -> Targets:
    """All position targets of the excitation."""
    config = ExcitationConfig()
    motion = Excitation(robot, config, RATE_HZ)
    sensed = readings(robot, Rotation.identity())
    times = np.arange(0.0, motion.duration_s, 1.0 / RATE_HZ)
    inputs = [PolicyInput(at, sensed, np.zeros(3), np.zeros(3), 0.3) for at in times.tolist()]
    motion.reset(inputs[0])
    away = np.array([motion.act(each).position for each in inputs]) - robot.default_pose
    began_s = motion.duration_s - config.burst_s - 2 * config.chirp_s
    return Targets(away, np.floor((times - began_s) / config.chirp_s))


@pytest.mark.parametrize("name", ["go1", "g1", "hexapod"])
def test_all_targets_are_within_the_soft_limits(name: str) -> None:
    robot = load_robot(name)
    low, high = robot.soft_limits
    target = targets(robot).away + robot.default_pose
    assert (low < target).all()
    assert (target < high).all()


def test_the_chirps_move_about_two_poses_in_which_gravity_acts_differently() -> None:
    robot = load_robot("go1")
    away, chirp = targets(robot)
    first, second = (away[chirp == number].mean(axis=0) for number in (0, 1))
    assert (np.abs(first) > 0.15).all()
    assert (np.abs(second) > 0.15).all()
    assert (np.sign(first) == -np.sign(second)).all()
    hip, thigh, _ = (first * swing_senses(robot))[robot.foot_joints[0]]
    assert np.sign(hip) != np.sign(thigh)

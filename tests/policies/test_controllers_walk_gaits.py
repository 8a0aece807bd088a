"""The gait generator through whole gaits: continuity, limits, changes while walking."""

from dataclasses import replace

import numpy as np
import pytest
from moments import policy_input

from footfall.common.errors import UserError
from footfall.policies.controllers.gait import GaitConfig, GaitTiming
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.walk import Walk
from footfall.policies.controllers.walk.config import WalkConfig
from footfall.policies.controllers.walk.feet import FootCycle
from footfall.policies.controllers.walk.foot import Footing
from footfall.policies.gaits import find_gait
from footfall.robots.actuator import friction_torque
from footfall.robots.description import Robot, load_robot
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("hexapod")
LEGS = ROBOT.legs
GAITS = ("tripod", "ripple", "wave")
FEET = LEGS.default_foot * np.array([1.0, 1.0, 0.0])
STILL = Footing(FEET, np.tile(np.eye(2), (6, 1, 1)))  # points, which do not roll
MOVING = [0.08, -0.05, 0.2]
ALL = [True] * 6


def cycle(gait: str) -> FootCycle:
    duty, phase = find_gait(gait, ROBOT)
    return FootCycle(STILL, GaitTiming(1.3, duty), phase)


def course(feet: FootCycle, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Feet (ticks, feet, 3) and whether they swing (ticks, feet), each millisecond."""
    positions, swings = [], []
    for _ in range(round(seconds / 0.001)):
        feet.advance(MOVING, 0.001, 0.03, ALL)
        positions.append(feet.feet.copy())
        swings.append(feet.swings.copy())
    return np.array(positions), np.array(swings)


@pytest.mark.parametrize("gait", GAITS)
class TestFeet:
    def test_position_and_velocity_are_continuous(self, gait: str) -> None:
        """A swing of this length and height accelerates by at most 5 m/s^2: 0.005 m/s in a millisecond."""
        feet = cycle(gait)
        positions, _ = course(feet, 4.0)
        velocity = np.diff(positions, axis=0) / 0.001
        swing_s = feet.timing.swing_s
        limit = 0.03 * 2 * np.pi**2 / swing_s**2 + 5.8 * 0.12 / swing_s**2
        assert np.abs(np.diff(velocity, axis=0)).max() / 0.001 < 1.5 * limit
        assert np.abs(np.diff(positions, axis=0)).max() < 0.002


UP = np.array([0.0, 0.0, 9.81])


class Trial:
    """Lets a policy act on a robot that follows its commands exactly.

    Its motors give the torque that the legs and their gearboxes take, and carry the weight as commanded.
    """

    def __init__(self, policy: Walk, robot: Robot = ROBOT) -> None:
        self.policy, self.ticks, self.robot = policy, 0, robot
        self.legs, self.motor = robot.legs, robot.motor
        self.inertia, self.still = nominal_body(robot).leg_inertia, np.zeros(len(robot.joint_names))
        self.joint, self.velocity, self.torque = robot.default_pose, self.still, self.still
        policy.reset(policy_input(robot))

    def walk(self, command: tuple[float, float, float], seconds: float) -> np.ndarray:
        """Joint targets, (ticks, n)."""
        targets = []
        for _ in range(round(seconds * self.policy.rate_hz)):
            time_s = self.ticks / self.policy.rate_hz
            found = {"joint": self.joint, "velocity": self.velocity, "torque": self.torque}
            result = self.policy.act(policy_input(self.robot, time_s, command, base_height=0.18, **found))
            acceleration = self.legs.gather(result.velocity - self.velocity) * self.policy.rate_hz
            inertial = (self.inertia @ acceleration[:, :, None])[:, :, 0]
            own = inertial + self.legs.holding_torque(result.position, UP)
            lost = friction_torque(result.velocity, self.motor)
            self.torque = self.legs.scatter(own, self.still) - lost + result.torque
            self.joint, self.velocity = result.position, result.velocity
            targets.append(result.position)
            self.ticks += 1
        return np.array(targets)


def test_it_notes_slowed_motion_once() -> None:
    trial = Trial(Walk(ROBOT, "ripple"))
    trial.walk((0.2, 0.0, 0.0), 2.5)
    (note,) = trial.policy.notes
    assert note.startswith("ripple: the gait is slowed to a period of ")
    trial.walk((-0.1, 0.0, 0.3), 2.5)
    assert trial.policy.notes == [note]


def test_strides_are_shortened_where_the_stability_margin_would_be_too_small() -> None:
    config = controller_settings(ROBOT, "tripod", WalkConfig)
    careful = Walk(ROBOT, "tripod", replace(config, limits=replace(config.limits, margin_m=0.115)))
    targets = Trial(careful).walk((0.2, 0.0, 0.0), 3.0)
    assert " m of 0.115 m" in careful.notes[0]
    usual = Trial(Walk(ROBOT, "tripod")).walk((0.2, 0.0, 0.0), 3.0)
    careful_coxae, usual_coxae = (np.ptp(each[-500:, 0::3], axis=0) for each in (targets, usual))
    assert np.all(careful_coxae < 0.9 * usual_coxae)


@pytest.mark.parametrize("period_s", [1.3, 2.0])
def test_a_swaying_walk_has_its_margin_at_any_period(go1: Robot, period_s: float) -> None:
    """A faster gait needs less sway; the weight shifts equally far in all of them."""
    config = controller_settings(go1, "walk", WalkConfig)
    gait, limits = replace(config.gait, period_s=period_s), replace(config.limits, margin_m=0.02)
    walk = Walk(go1, "walk", replace(config, gait=gait, limits=limits))
    Trial(walk, go1).walk((0.15, 0.0, 0.0), 1.0)
    assert "0.006 m of 0.020 m" in walk.notes[0]


def test_a_gait_for_other_feet_is_refused_and_a_new_episode_begins_with_the_settings() -> None:
    policy = Walk(ROBOT, "tripod")
    with pytest.raises(UserError, match="'trot'"):
        policy.change(GaitConfig("trot", 1.0))
    first = Trial(policy).walk((0.1, 0.0, 0.0), 1.5)
    np.testing.assert_array_equal(first, Trial(Walk(ROBOT, "tripod")).walk((0.1, 0.0, 0.0), 1.5))
    policy.change(GaitConfig("wave", 2.0))
    Trial(policy).walk((0.1, 0.0, 0.0), 0.1)
    np.testing.assert_array_equal(Trial(policy).walk((0.1, 0.0, 0.0), 1.5), first)

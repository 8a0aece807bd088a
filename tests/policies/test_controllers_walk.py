"""The gait generator: commands at single times, joint targets of whole gaits, and walks on a plant."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from direct_plant import DirectPlant, walk
from direct_plant import Walk as Walked
from moments import policy_input
from scipy.spatial.transform import Rotation

from footfall import JointCommand, PolicyInput, Robot, UserError, load_policy, load_robot
from footfall.common.rotations import tilt
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.walk import Walk
from footfall.policies.controllers.walk.config import HeadingConfig, WalkConfig
from footfall.policies.controllers.walk.heading import Heading
from footfall.policies.controllers.walk.limits import Pace, WalkLimits
from footfall.robots.actuator import friction_torque
from footfall.robots.rigid_body import nominal_body

ROBOT, HEXAPOD = load_robot("go1"), load_robot("hexapod")
LEGS = ROBOT.legs
OWN = controller_settings(ROBOT, "trot", WalkConfig)
CONFIG = replace(OWN, heading=HeadingConfig(0.0, 0.0))
RATE_HZ = CONFIG.rate_hz
STILL, FORWARD = (0.0, 0.0, 0.0), (0.4, 0.0, 0.0)
FEET = LEGS.default_foot + [[0, side * CONFIG.stance.outward_m, 0] for side in (-1, 1, -1, 1)]
FEET[:, 2] = LEGS.foot_radius - CONFIG.step.body_height_m
PERIOD = round(CONFIG.gait.period_s * RATE_HZ)  # ticks


def seen(
    time_s: float = 0.0, command: Any = STILL, roll: float = 0.0, yaw: float = 0.0, **more: Any
) -> PolicyInput:
    """Inputs of a robot turned about one axis, by default with legs in the default pose and no torque."""
    turn = Rotation.from_rotvec([roll, 0.0, yaw])
    return policy_input(ROBOT, time_s, command, turn=turn, base_height=0.28, **more)


def commands(policy: Walk, *stages: tuple[float, Any], **more: Any) -> list[JointCommand]:
    """Joint commands from a settled stance on, at each tick of the stages: seconds and velocity command."""
    policy.reset(seen(**more))
    given = [command for seconds, command in stages for _ in range(round(seconds * RATE_HZ))]
    times_s = CONFIG.settle_s + np.arange(len(given)) / RATE_HZ
    return [policy.act(seen(*each, **more)) for each in zip(times_s.tolist(), given, strict=True)]


def feet(targets: list[JointCommand]) -> np.ndarray:
    """Commanded feet (ticks, legs, 3)."""
    return np.array([LEGS.pose(each.position).foot for each in targets])


@pytest.mark.parametrize("command", [(0.3, 0.0, 0.0), (0.0, 0.2, 0.0), (-0.1, 0.1, 0.6)])
def test_the_point_under_each_standing_foot_moves_with_the_ground(command: Any) -> None:
    """Standing feet move back under a base that moves by v + w x r.

    A foot is a sphere that rolls: as its shank turns, the point under it goes farther than its centre. The
    motion is computed with MuJoCo's Jacobians, in mid-stance.
    """
    vx, vy, yaw = command
    for result in commands(Walk(ROBOT, "trot", CONFIG), (4 * PERIOD / RATE_HZ, command))[-PERIOD:]:
        pose = LEGS.pose(result.position)
        x, y, z = pose.foot.T
        middle = (np.abs(pose.foot[:, :2] - FEET[:, :2]).max(axis=1) < 0.003) & (z < FEET[:, 2] + 1e-6)
        contact = pose.jacobian + LEGS.rolling_offset(pose.axes, np.array([0.0, 0.0, 1.0]))
        velocity = (contact @ LEGS.gather(result.velocity)[:, :, None])[middle, :2, 0]
        expected = np.stack([-(vx - yaw * y), -(vy + yaw * x)], axis=1)[middle]
        np.testing.assert_allclose(velocity, expected, atol=6e-3)


def test_a_stopped_walk_returns_its_feet_to_their_positions() -> None:
    policy = Walk(ROBOT, "trot", CONFIG)
    results = commands(policy, (1.37, (0.8, 0.2, -0.5)), (1.5, STILL))
    np.testing.assert_allclose(feet(results)[-1], FEET, atol=0.0101)
    assert not results[-1].velocity.any()
    assert policy.stance().tolist() == [1.0] * 4  # type: ignore[union-attr]


def test_with_a_sway_the_weight_is_shifted_first_and_back_last() -> None:
    """Feet move to one side together before one of them lifts off, and return at the end."""
    results = commands(Walk(ROBOT, "walk"), (0.1, STILL), (1.1, (0.3, 0.0, 0.0)), (2.0, STILL))
    course, ticks = feet(results), round(0.1 * RATE_HZ)
    before = course[ticks - 1]
    after = course[2 * ticks - 1] - before
    np.testing.assert_allclose(after, np.tile([0.0, after[0, 1], 0.0], (4, 1)), atol=1e-9)
    assert np.abs(after[0, 1]) > 0.008
    np.testing.assert_allclose(course[-1], before, atol=0.0101)
    assert not results[-1].velocity.any()


@pytest.mark.parametrize(("turned", "back"), [(0.1, -0.2), (-0.05, 0.1), (0.5, -0.4), (-3.0, 0.4)])
def test_a_robot_returns_to_the_heading_of_its_start(turned: float, back: float) -> None:
    """The gain is 2, and at most 0.2 rad are corrected."""
    heading = Heading(HeadingConfig(2.0, 0.2))
    assert heading.correction(1.0, 0.0) == 0.0
    assert heading.correction(1.0 + turned, 0.0) == pytest.approx(back)


def test_a_standing_robot_forgets_its_heading() -> None:
    """After a turn by half a circle it starts like a robot without a heading."""
    positions = []
    for config in (replace(CONFIG, heading=HeadingConfig(2.0, 0.2)), CONFIG):
        policy = Walk(ROBOT, "trot", config)
        policy.reset(seen())
        policy.act(seen(CONFIG.settle_s, FORWARD, yaw=1.0))
        for k in range(2 * PERIOD):
            policy.act(seen(CONFIG.settle_s + k / RATE_HZ, yaw=1.0))
        start = seen(CONFIG.settle_s + 2.0, FORWARD, yaw=-2.0)
        positions.append([policy.act(start).position for _ in range(20)])
    np.testing.assert_array_equal(*positions)


def test_unloaded_standing_feet_are_lowered_to_find_the_ground() -> None:
    assert CONFIG.touch_down is not None
    touch_down = replace(CONFIG.touch_down, from_progress=0.5, probe_m=0.01, probe_m_s=0.03)
    policy, joint = Walk(ROBOT, "trot", replace(CONFIG, touch_down=touch_down)), LEGS.solve(FEET)
    results = commands(policy, (0.5, STILL), joint=LEGS.scatter(joint, ROBOT.default_pose))
    expected = -np.minimum(0.03 * (np.arange(len(results)) + 1) / RATE_HZ, 0.01)
    np.testing.assert_allclose((feet(results) - FEET)[:, :, 2], np.tile(expected, (4, 1)).T, atol=1e-6)


def tempos(monkeypatch: pytest.MonkeyPatch, *phases: tuple[float, float]) -> np.ndarray:
    """Advance of the gait's clock, (phases, ticks), relative to that at full speed.

    Each phase is a walk ahead for 0.6 s at a speed that allows a certain tempo.
    """
    policy, allowed = Walk(ROBOT, "trot", CONFIG), {round(speed, 6): tempo for speed, tempo in phases}
    monkeypatch.setattr(WalkLimits, "pace", lambda _, walk: Pace(tempo=allowed[round(walk.velocity[0], 6)]))
    policy.reset(seen())
    clocks, ticks = [0.0], round(0.6 * RATE_HZ)
    for k, speed in enumerate(np.repeat([speed for speed, _ in phases], ticks).tolist()):
        policy.act(seen(CONFIG.settle_s + k / RATE_HZ, (speed, 0.0, 0.0)))
        clocks.append(policy.stepping.cycle.clock)
    return (np.diff(clocks) % 1.0 * CONFIG.gait.period_s * RATE_HZ).reshape(len(phases), ticks)


def test_the_tempo_falls_at_once_and_rises_by_half_in_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    first, slow, faster = tempos(monkeypatch, (0.30, 1.0), (0.31, 0.6), (0.32, 0.8))
    assert (first[-1], faster[-1]) == pytest.approx((1.0, 0.8))
    np.testing.assert_allclose(slow, 0.6)
    np.testing.assert_allclose(np.diff(faster[100:150]), 0.5 / RATE_HZ, rtol=1e-6)
    # Between two speeds the tempo suits both.
    before, after = tempos(monkeypatch, (0.35, 0.7), (0.25, 1.0))
    ticks = int((0.35 - 0.25) / CONFIG.command.acceleration_m_s2 * RATE_HZ) - 1
    assert ticks > 10
    np.testing.assert_allclose([*before[-10:], *after[:ticks]], 0.7)
    assert after[-1] > 0.8


@pytest.mark.parametrize("gait", ["trot", "walk"])  # the latter sways
def test_a_new_episode_forgets_the_last_to_the_bit(gait: str) -> None:
    policy = Walk(ROBOT, gait)
    commands(policy, (0.4, FORWARD))
    policy.act(seen(CONFIG.settle_s + 0.4, FORWARD, roll=0.2))
    again, first = (commands(each, (0.3, FORWARD)) for each in (policy, Walk(ROBOT, gait)))
    np.testing.assert_array_equal(again, first)


class Trial:
    """Lets a policy act on a robot that follows its commands exactly.

    Its motors give the torque that the legs and their gearboxes take, and carry the weight as commanded.
    """

    def __init__(self, policy: Walk, robot: Robot = HEXAPOD) -> None:
        self.policy, self.ticks, self.robot = policy, 0, robot
        self.inertia, self.still = nominal_body(robot).leg_inertia, np.zeros(len(robot.joint_names))
        self.joint, self.velocity, self.torque = robot.default_pose, self.still, self.still
        policy.reset(policy_input(robot))

    def walk(self, command: tuple[float, float, float], seconds: float) -> np.ndarray:
        """Joint targets, (ticks, n)."""
        targets, legs = [], self.robot.legs
        for _ in range(round(seconds * self.policy.rate_hz)):
            time_s = self.ticks / self.policy.rate_hz
            found = {"joint": self.joint, "velocity": self.velocity, "torque": self.torque}
            result = self.policy.act(policy_input(self.robot, time_s, command, base_height=0.18, **found))
            acceleration = legs.gather(result.velocity - self.velocity) * self.policy.rate_hz
            inertial = (self.inertia @ acceleration[:, :, None])[:, :, 0]
            own = inertial + legs.holding_torque(result.position, np.array([0.0, 0.0, 9.81]))
            lost = friction_torque(result.velocity, self.robot.motor)
            self.torque = legs.scatter(own, self.still) - lost + result.torque
            self.joint, self.velocity = result.position, result.velocity
            targets.append(result.position)
            self.ticks += 1
        return np.array(targets)


def test_it_notes_slowed_motion_once() -> None:
    trial = Trial(Walk(HEXAPOD, "ripple"))
    trial.walk((0.2, 0.0, 0.0), 2.5)
    (note,) = trial.policy.notes
    assert note.startswith("ripple: the gait is slowed to a period of ")
    trial.walk((-0.1, 0.0, 0.3), 2.5)
    assert trial.policy.notes == [note]


def test_strides_are_shortened_where_the_stability_margin_would_be_too_small() -> None:
    config = controller_settings(HEXAPOD, "tripod", WalkConfig)
    careful = Walk(HEXAPOD, "tripod", replace(config, limits=replace(config.limits, margin_m=0.115)))
    targets = [Trial(each).walk((0.2, 0.0, 0.0), 3.0) for each in (careful, Walk(HEXAPOD, "tripod"))]
    assert " m of 0.115 m" in careful.notes[0]
    careful_coxae, usual_coxae = (np.ptp(each[-500:, 0::3], axis=0) for each in targets)
    assert np.all(careful_coxae < 0.9 * usual_coxae)


@pytest.mark.parametrize("period_s", [1.3, 2.0])
def test_a_swaying_walk_has_its_margin_at_any_period(period_s: float) -> None:
    """A faster gait needs less sway; the weight shifts equally far in all of them."""
    config = controller_settings(ROBOT, "walk", WalkConfig)
    gait, limits = replace(config.gait, period_s=period_s), replace(config.limits, margin_m=0.02)
    policy = Walk(ROBOT, "walk", replace(config, gait=gait, limits=limits))
    Trial(policy, ROBOT).walk((0.15, 0.0, 0.0), 1.0)
    assert "0.006 m of 0.020 m" in policy.notes[0]


def test_a_gait_for_other_feet_is_refused_and_a_new_episode_begins_with_the_settings() -> None:
    policy = Walk(HEXAPOD, "tripod")
    with pytest.raises(UserError, match="'trot'"):
        policy.change(GaitConfig("trot", 1.0))
    first = Trial(policy).walk((0.1, 0.0, 0.0), 1.5)
    np.testing.assert_array_equal(first, Trial(Walk(HEXAPOD, "tripod")).walk((0.1, 0.0, 0.0), 1.5))
    policy.change(GaitConfig("wave", 2.0))
    Trial(policy).walk((0.1, 0.0, 0.0), 0.1)
    np.testing.assert_array_equal(Trial(policy).walk((0.1, 0.0, 0.0), 1.5), first)


def on_plant(
    policy: Walk, command: Any, duration_s: float, change: Callable[[int], None] = lambda _: None
) -> tuple[Walked, float]:
    """A walk by the true base velocity, and the largest tilt, rad; `change` is called with each tick."""
    tilts: list[float] = []

    def record(time_s: float, plant: DirectPlant) -> None:
        tilts.append(float(tilt(plant.data.qpos[3:7])))
        change(round(time_s * 500))

    result = walk(policy, DirectPlant(ROBOT), lambda _: np.array(command), duration_s, on_tick=record)
    return result, max(tilts)


def drift(result: Walked, after_s: float) -> float:
    """Distance walked after a time, m."""
    return float(np.linalg.norm(result.position[-1] - result.position[int(after_s * 500)]))


@pytest.mark.parametrize(
    ("name", "push", "after_s", "moved_m"),
    [
        *((name, None, 1.0, 0.02) for name in ("stand", "trot", "mpc")),
        ("mpc", (0.5, np.array([0.2, 0.8, 0.0])), 3.5, 0.01),
    ],
)
def test_a_command_of_zero_means_stand_still(name: str, push: Any, after_s: float, moved_m: float) -> None:
    """After a push a robot stands again."""
    policy, duration_s = load_policy(name, ROBOT), 4.0 if push else 2.0
    result = walk(policy, DirectPlant(ROBOT), lambda _: np.zeros(3), duration_s, BaseEstimator(ROBOT), push)
    assert not result.fell
    assert drift(result, after_s) < moved_m


@pytest.mark.parametrize("gait", ["walk", "bound"])
def test_every_gait_follows_the_command_with_a_level_body(gait: str) -> None:
    result, max_tilt_rad = on_plant(Walk(ROBOT, gait), (0.4, 0.1, 0.2), 3.0)
    assert not result.fell
    np.testing.assert_allclose(result.mean_velocity(1.5), (0.4, 0.1, 0.2), atol=0.07)
    assert max_tilt_rad < 0.12


def test_a_slow_walk_stays_on_its_feet() -> None:
    """Without sway, at 2 s per cycle, the body would tip towards the foot in the air.

    The robot walks backwards, which is harder for this order of the feet.
    """
    config = controller_settings(ROBOT, "walk", WalkConfig)
    policy = Walk(ROBOT, "walk", replace(config, gait=GaitConfig("walk", 2.0)))
    result, max_tilt_rad = on_plant(policy, (-0.15, 0.0, 0.0), 6.5)
    assert not result.fell
    assert max_tilt_rad < 0.15
    np.testing.assert_allclose(result.mean_velocity(4.5), (-0.15, 0.0, 0.0), atol=0.035)  # over a cycle
    assert policy.notes == []


def test_a_slow_trot_is_refused_and_the_robot_stands() -> None:
    policy = Walk(ROBOT, "trot", replace(OWN, gait=GaitConfig("trot", 1.0)))
    assert drift(on_plant(policy, (0.3, 0.0, 0.0), 2.0)[0], 1.0) < 0.01
    (note,) = policy.notes
    assert note.startswith("trot: the robot does not walk, however short its strides are: the stability")
    assert note.endswith("a shorter gait.period_s, a larger gait.duty or more stance.sway would help")


def test_gait_and_steps_change_while_walking() -> None:
    """Every second the controller gets another gait and other steps, at any phase.

    The robot neither falls nor stops.
    """
    policy, step = Walk(ROBOT, "trot"), OWN.step
    others = {
        500: (GaitConfig("walk", 0.5), replace(step, height_m=0.04)),
        1013: (GaitConfig("pace", 0.25, 0.55), replace(step, body_height_m=0.25)),
        1507: (GaitConfig("bound", 0.25, 0.6), replace(step, length_m=0.2)),
        2022: (GaitConfig("gallop", 0.25, 0.75), step),
        2531: (GaitConfig("trot", 0.4, 0.6), replace(step, height_m=0.08)),
    }
    unchanged = (None, None)
    result, max_tilt_rad = on_plant(policy, FORWARD, 6.0, lambda k: policy.change(*others.get(k, unchanged)))
    assert not result.fell
    assert max_tilt_rad < 0.2
    assert np.array(result.velocity)[600:, 0].reshape(-1, 300).mean(axis=1).min() > 0.25
    np.testing.assert_allclose(result.mean_velocity(5.5)[0], 0.4, atol=0.05)

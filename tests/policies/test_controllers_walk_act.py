"""Commands of the gait generator at single times, on four legs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from moments import policy_input
from scipy.spatial.transform import Rotation

from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.walk import Walk
from footfall.policies.controllers.walk.config import HeadingConfig, WalkConfig
from footfall.policies.controllers.walk.heading import Heading
from footfall.policies.controllers.walk.limits import Pace, WalkLimits
from footfall.policies.policy import PolicyInput
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
LEGS = ROBOT.legs
CONFIG = replace(controller_settings(ROBOT, "trot", WalkConfig), heading=HeadingConfig(0.0, 0.0))
FORWARD = (0.4, 0.0, 0.0)
FEET = LEGS.default_foot + [[0, side * CONFIG.stance.outward_m, 0] for side in (-1, 1, -1, 1)]
FEET[:, 2] = LEGS.foot_radius - CONFIG.step.body_height_m
NOTHING = np.zeros(12)
PERIOD = round(CONFIG.gait.period_s * CONFIG.rate_hz)  # ticks


def make() -> Walk:
    return Walk(ROBOT, "trot", CONFIG)


def seen(
    time_s: float = 0.0, command: Any = (0.0, 0.0, 0.0), roll: float = 0.0, yaw: float = 0.0, **more: Any
) -> PolicyInput:
    """Inputs of a robot turned about one axis, by default with legs in the default pose and no torque."""
    turn = Rotation.from_rotvec([roll, 0.0, yaw])
    return policy_input(ROBOT, time_s, command, turn=turn, base_height=0.28, **more)


def feet_of(command_position: np.ndarray) -> np.ndarray:
    return LEGS.pose(command_position).foot


def walking(policy: Walk, command: tuple[float, float, float] = FORWARD, seconds: float = 1.0) -> np.ndarray:
    """Walk from a settled stance and return commanded feet, (ticks, legs, 3)."""
    policy.reset(seen())
    dt_s, start = 1 / policy.rate_hz, CONFIG.settle_s
    ticks = round(seconds * policy.rate_hz)
    return np.array([feet_of(policy.act(seen(start + k * dt_s, command)).position) for k in range(ticks)])


@pytest.mark.parametrize("command", [(0.3, 0.0, 0.0), (0.0, 0.2, 0.0), (-0.1, 0.1, 0.6)])
def test_the_point_under_each_standing_foot_moves_with_the_ground(
    command: tuple[float, float, float],
) -> None:
    """Standing feet move back under a base that moves by v + w x r.

    A foot is a sphere that rolls: as its shank turns, the point under it goes farther than its centre. The
    motion is computed with MuJoCo's Jacobians, in mid-stance.
    """
    policy = make()
    policy.reset(seen())
    targets = [policy.act(seen(CONFIG.settle_s + k / CONFIG.rate_hz, command)) for k in range(4 * PERIOD)]
    vx, vy, yaw = command
    for result in targets[-PERIOD:]:
        pose = LEGS.pose(result.position)
        x, y, z = pose.foot.T
        middle = (np.abs(pose.foot[:, :2] - FEET[:, :2]).max(axis=1) < 0.003) & (z < FEET[:, 2] + 1e-6)
        contact = pose.jacobian + LEGS.rolling_offset(pose.axes, np.array([0.0, 0.0, 1.0]))
        velocity = (contact @ LEGS.gather(result.velocity)[:, :, None])[middle, :2, 0]
        expected = np.stack([-(vx - yaw * y), -(vy + yaw * x)], axis=1)[middle]
        np.testing.assert_allclose(velocity, expected, atol=6e-3)


def test_a_stopped_walk_returns_its_feet_to_their_positions() -> None:
    policy = make()
    walking(policy, (0.8, 0.2, -0.5), seconds=1.37)
    start = CONFIG.settle_s + 1.37
    for k in range(round(1.5 * CONFIG.rate_hz)):
        result = policy.act(seen(start + k / CONFIG.rate_hz))
    np.testing.assert_allclose(feet_of(result.position), FEET, atol=0.0101)
    assert not result.velocity.any()
    assert policy.stance().tolist() == [1.0] * 4  # type: ignore[union-attr]


def test_with_a_sway_the_weight_is_shifted_first_and_back_last() -> None:
    """Feet move to one side together before one of them lifts off, and return at the end."""
    policy = Walk(ROBOT, "walk")
    before = walking(policy, (0.0, 0.0, 0.0), seconds=0.1)[-1]
    after = walking(policy, (0.3, 0.0, 0.0), seconds=0.1)[-1] - before
    np.testing.assert_allclose(after, np.tile(after[0], (4, 1)), atol=1e-9)
    assert np.abs(after[0, 1]) > 0.008
    np.testing.assert_allclose(after[:, [0, 2]], 0.0, atol=1e-9)
    start = CONFIG.settle_s + 0.1
    for k in range(round(3.0 * CONFIG.rate_hz)):
        command = (0.3, 0.0, 0.0) if k < CONFIG.rate_hz else (0.0, 0.0, 0.0)
        result = policy.act(seen(start + k / CONFIG.rate_hz, command))
    np.testing.assert_allclose(feet_of(result.position), before, atol=0.0101)
    assert not result.velocity.any()


class TestHeading:
    """Correction of the heading with a gain of 2, for at most 0.2 rad."""

    CONFIG = HeadingConfig(2.0, 0.2)

    @pytest.fixture
    def heading(self) -> Heading:
        heading = Heading(self.CONFIG)
        assert heading.correction(1.0, 0.0) == 0.0  # it keeps the heading of its start
        return heading

    @pytest.mark.parametrize(("turned", "back"), [(0.1, -0.2), (-0.05, 0.1), (0.5, -0.4), (-3.0, 0.4)])
    def test_a_robot_returns_to_its_heading(self, heading: Heading, turned: float, back: float) -> None:
        assert heading.correction(1.0 + turned, 0.0) == pytest.approx(back)

    def test_a_standing_robot_forgets_its_heading(self) -> None:
        """After a turn by half a circle it starts like a robot without a heading."""
        both = Walk(ROBOT, "trot", replace(CONFIG, heading=self.CONFIG)), make()
        positions = []
        for policy in both:
            policy.reset(seen())
            policy.act(seen(CONFIG.settle_s, FORWARD, yaw=1.0))
            for k in range(2 * PERIOD):
                policy.act(seen(CONFIG.settle_s + k / CONFIG.rate_hz, yaw=1.0))
            off = [policy.act(seen(CONFIG.settle_s + 2.0, FORWARD, yaw=-2.0)) for _ in range(20)]
            positions.append([result.position for result in off])
        np.testing.assert_array_equal(*positions)


class TestGround:
    """According to the clock some feet stand and others swing.

    Some standing feet carry no load, and some swinging feet carry load.
    """

    assert CONFIG.touch_down is not None
    TOUCH_DOWN = replace(CONFIG.touch_down, from_progress=0.5, probe_m=0.01, probe_m_s=0.03)

    def heights(self, torque: np.ndarray, command: tuple[float, float, float], seconds: float) -> np.ndarray:
        """Height of the commanded feet above the ground, (ticks, legs) m, once it has settled."""
        policy = Walk(ROBOT, "trot", replace(CONFIG, touch_down=self.TOUCH_DOWN))
        policy.reset(seen(joint=LEGS.scatter(LEGS.solve(FEET), ROBOT.default_pose), torque=torque))
        times_s = CONFIG.settle_s + np.arange(round(seconds * CONFIG.rate_hz)) / CONFIG.rate_hz
        result = [policy.act(seen(time_s, command, torque=torque)).position for time_s in times_s.tolist()]
        return np.array([feet_of(each)[:, 2] for each in result]) - FEET[:, 2]

    def test_unloaded_standing_feet_are_lowered_to_find_the_ground(self) -> None:
        down = self.heights(NOTHING, (0.0, 0.0, 0.0), 0.5)
        time_s = (np.arange(len(down)) + 1) / CONFIG.rate_hz
        expected = -np.minimum(0.03 * time_s, 0.01)
        np.testing.assert_allclose(down, np.tile(expected, (4, 1)).T, atol=1e-6)


class TestTempo:
    """Advance of the gait's clock in each tick, relative to that at full speed."""

    def tempos(self, monkeypatch: pytest.MonkeyPatch, *phases: tuple[float, float]) -> np.ndarray:
        """Tempos (phases, ticks) of walks ahead for 0.6 s, at speeds that allow certain tempos."""
        policy, allowed = make(), {round(speed, 6): tempo for speed, tempo in phases}
        monkeypatch.setattr(
            WalkLimits, "pace", lambda _, walk: Pace(tempo=allowed[round(walk.velocity[0], 6)])
        )
        policy.reset(seen())
        clocks, ticks = [0.0], round(0.6 * CONFIG.rate_hz)
        for k, speed in enumerate(np.repeat([speed for speed, _ in phases], ticks).tolist()):
            policy.act(seen(CONFIG.settle_s + k / CONFIG.rate_hz, (speed, 0.0, 0.0)))
            clocks.append(policy.stepping.cycle.clock)
        passed = np.diff(clocks) % 1.0 * CONFIG.gait.period_s
        return (passed * CONFIG.rate_hz).reshape(len(phases), ticks)

    def test_the_tempo_falls_at_once_and_rises_by_half_in_a_second(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        first, slow, faster = self.tempos(monkeypatch, (0.30, 1.0), (0.31, 0.6), (0.32, 0.8))
        assert first[-1] == pytest.approx(1.0)
        np.testing.assert_allclose(slow, 0.6)
        np.testing.assert_allclose(np.diff(faster[100:150]), 0.5 / CONFIG.rate_hz, rtol=1e-6)
        assert faster[-1] == pytest.approx(0.8)

    def test_the_tempo_between_two_speeds_suits_both(self, monkeypatch: pytest.MonkeyPatch) -> None:
        before, after = self.tempos(monkeypatch, (0.35, 0.7), (0.25, 1.0))
        ticks = int((0.35 - 0.25) / CONFIG.command.acceleration_m_s2 * CONFIG.rate_hz) - 1
        assert ticks > 10
        np.testing.assert_allclose([*before[-10:], *after[:ticks]], 0.7)
        assert after[-1] > 0.8


@pytest.mark.parametrize("gait", ["trot", "walk"])  # the latter sways
def test_a_new_episode_forgets_the_last_to_the_bit(gait: str) -> None:
    policy = Walk(ROBOT, gait)
    walking(policy, seconds=0.4)
    policy.act(seen(CONFIG.settle_s + 0.4, FORWARD, roll=0.2))
    np.testing.assert_array_equal(walking(policy, seconds=0.3), walking(Walk(ROBOT, gait), seconds=0.3))

"""A lying robot stands up; it lies down before its motors are disabled if the fault permits."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from deploy_policies import Hold, not_a_number, short_episode

from footfall import Policy, Robot, Trace, UserError, load_policy, load_robot, run_episode
from footfall.common.rotations import tilt
from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import HELD, Mode
from footfall.deploy.pose_path import PosePath
from footfall.deploy.postures import MotionBefore, Postures
from footfall.plant.injection import InjectingPolicy
from footfall.plant.robot import SimulatedRobot

CONFIG = DeployConfig()
POSED = (Mode.STANDING, Mode.LOWERING)
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
QUICK = DeployConfig(joint_rate_hz=250.0, stand_s=0.2, pose_rate_rad_s=3.0, stop_rate_rad_s=3.0, stop_s=0.1)

TOP_SPEED = np.array([1.8, 0.0, 0.0])


class Tick(NamedTuple):
    mode: Mode
    target: np.ndarray
    height_m: float
    tilt_rad: float


class Notebook:
    """Mode, targets and readings of each tick."""

    def __init__(self, then: Callable[[ControlLoop, SimulatedRobot], None] | None = None) -> None:
        self.ticks: list[Tick] = []
        self._then = then

    def __call__(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        base_pose = body.data.qpos[:7].copy()
        self.ticks.append(Tick(loop.state.mode, loop.target, base_pose[2], tilt(base_pose[3:])))
        if self._then is not None:
            self._then(loop, body)

    @property
    def modes(self) -> list[str]:
        """Modes of the run, one after the other."""
        modes = [tick.mode.value for tick in self.ticks]
        return [mode for mode, before in zip(modes, ["", *modes], strict=False) if mode != before]

    def of(self, mode: Mode) -> list[Tick]:
        return [tick for tick in self.ticks if tick.mode is mode]

    def fastest(self) -> float:
        """Largest change of a target per tick, rad, while the robot stood up or lay down."""
        targets = np.array([tick.target for tick in self.ticks])
        posed = [tick.mode in POSED for tick in self.ticks]
        between = np.array(posed[1:]) & [tick.mode in HELD for tick in self.ticks[:-1]]
        return float(np.abs(np.diff(targets, axis=0)[between]).max())


def run(robot: Robot, policy: Policy, note: Notebook | None = None, **changes: object) -> Trace:
    settings = {"lying": True, "lie_down": True, "config": QUICK, "duration_s": 0.1} | changes
    return run_episode(robot, policy, short_episode(**settings), note)


def test_a_paths_duration_is_that_of_the_longest_travel() -> None:
    """A travel of one radian has pi/2 rad/s in the middle of the path, and 1 rad/s on average."""
    path = PosePath([np.array([0.0, 0.0]), np.array([0.25, 1.0])], [np.pi / 2])
    assert path.duration_s == pytest.approx(1.0)
    np.testing.assert_allclose(path.at(0.5), [0.125, 0.5])
    assert (path.at(0.501) - path.at(0.499))[1] / 0.002 == pytest.approx(np.pi / 2, rel=1e-4)


class TestPostures:
    def test_a_robot_lies_if_its_base_has_no_clearance(self, go1: Robot) -> None:
        postures = Postures(go1, CONFIG, lie_down=True)
        postures.stand_up(go1.lying_pose + 0.05, LEVEL)
        assert not postures.on_legs(0.0, Mode.STANDING)
        # In this crouch the clearance is 48 % smaller.
        postures.stand_up(np.tile([0.0, 1.2, -2.4], 4), LEVEL)
        assert postures.on_legs(0.0, Mode.STANDING)

    @pytest.mark.parametrize(
        ("before", "share", "rate_rad_s"),
        [(MotionBefore.STOPPED, 0.0, 8.0), (MotionBefore.WALKING, 0.7, 12.0)],
    )
    def test_feet_reach_the_ground_fast_and_the_rest_is_slow(
        self, go1: Robot, before: MotionBefore, share: float, rate_rad_s: float
    ) -> None:
        """Legs are stretched by 0.3 rad. From the default pose a calf moves by 0.9 rad to lying."""
        postures, stretched = Postures(go1, CONFIG, lie_down=True), go1.default_pose + np.tile([0, 0, 0.3], 4)
        postures.lie_down(stretched, before)
        fast_s = 0.5 * np.pi * (0.3 + share * 0.9) / rate_rad_s
        slow_s = 0.5 * np.pi * (1.0 - share) * 0.9 / CONFIG.pose_rate_rad_s
        between = (1.0 - share) * go1.default_pose + share * go1.lying_pose
        np.testing.assert_allclose(postures.command(fast_s).position, between, atol=1e-9)
        assert not postures.done(fast_s + slow_s + 0.29 * CONFIG.stand_s)
        assert postures.done(fast_s + slow_s + 0.3 * CONFIG.stand_s)


class TestRun:
    def test_a_run_from_lying_to_disabled_motors(self, go1: Robot) -> None:
        note = Notebook()
        outcome = run(go1, Hold(go1), note)
        standing_m, base_below = go1.description.standing_height_m, go1.legs.base_below
        assert note.modes == ["IDLE", "STANDING", "WALKING", "STOPPING", "LOWERING", "RELEASING"]
        assert (outcome.final_state, outcome.faults) == ("IDLE", ())
        assert note.ticks[0].height_m < base_below + 0.01
        assert note.of(Mode.WALKING)[0].height_m > 0.9 * standing_m
        assert note.ticks[-1].height_m < base_below + 0.01
        assert 0.9 < note.fastest() * QUICK.joint_rate_hz / QUICK.pose_rate_rad_s < 1.01
        assert max(tick.tilt_rad for tick in note.ticks) < 0.1
        released = note.of(Mode.RELEASING)
        assert np.ptp([tick.height_m for tick in released]) < 0.01  # nothing drops

    def test_a_policy_that_fails_at_top_speed_leaves_the_robot_on_its_belly(self, go1: Robot) -> None:
        """The kinetic energy would lift the robot by 0.17 m and turn it over if its feet stopped."""
        policy = InjectingPolicy(load_policy("go1-flat", go1))

        def fail(loop: ControlLoop, body: SimulatedRobot) -> None:
            if loop.walking and loop.walking_s > 1.2:
                policy.change_decision = not_a_number

        note, config = Notebook(fail), DeployConfig(stand_s=0.2)
        run(go1, policy, note, lying=False, config=config, duration_s=3.0, command_source=lambda _: TOP_SPEED)
        assert note.modes[2:] == ["WALKING", "LOWERING", "ESTOP"]
        assert max(tick.tilt_rad for tick in note.of(Mode.LOWERING)) < 0.8
        assert note.ticks[-1].tilt_rad < 0.1
        assert note.ticks[-1].height_m < go1.legs.base_below + 0.01

    def test_a_robot_stops_before_it_lies_down(self, go1: Robot) -> None:
        policy = Hold(go1)
        run(go1, policy, lying=False, command_source=lambda _: np.array([0.5, 0.0, 0.1]))
        commands = [seen.command.tolist() for seen in policy.seen]
        assert commands == [[0.5, 0.0, 0.1]] * 6 + [[0.0] * 3] * 5  # 0.1 s each, and both ends

    def test_a_robot_without_a_lying_pose_cannot_begin_in_it(self) -> None:
        biped = load_robot("g1")
        with pytest.raises(UserError, match=r"'g1'.*lying_rad"):
            run(biped, Hold(biped))

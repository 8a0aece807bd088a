"""A lying robot stands up; it lies down before its motors are disabled if the fault permits."""

from collections.abc import Callable
from dataclasses import replace
from itertools import groupby, pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from deploy_policies import Hold, not_a_number, short_episode

from footfall import Episode, Policy, Robot, Trace, UserError, load_policy, load_robot, run_episode
from footfall.common.rotations import tilt
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import HELD, Mode
from footfall.deploy.pose_path import PosePath
from footfall.deploy.postures import MotionBefore, Postures
from footfall.domain_rand.noise import Noise
from footfall.plant.injection import InjectingPolicy
from footfall.plant.robot import SimulatedRobot

CONFIG = DeployConfig()
QUICK = DeployConfig(joint_rate_hz=250.0, stand_s=0.2, pose_rate_rad_s=3.0, stop_rate_rad_s=3.0, stop_s=0.1)
G1 = load_robot("g1")


def run(
    robot: Robot, policy: Policy, at_tick: Callable[[ControlLoop], None] = lambda _: None, **changes: object
) -> tuple[Trace, list[SimpleNamespace]]:
    """A short run of a lying robot, which calls `at_tick` at each tick."""
    ticks: list[SimpleNamespace] = []

    def note(loop: ControlLoop, body: SimulatedRobot) -> None:
        height_m, tilt_rad = float(body.data.qpos[2]), tilt(body.data.qpos[3:7].copy())
        mode, target = loop.state.mode, loop.target
        ticks.append(SimpleNamespace(mode=mode, target=target, height_m=height_m, tilt_rad=tilt_rad))
        at_tick(loop)

    settings = {"lying": True, "lie_down": True, "config": QUICK, "duration_s": 0.1} | changes
    return run_episode(robot, policy, short_episode(**settings), note), ticks


def modes(ticks: list[SimpleNamespace]) -> list[str]:
    """Modes of the run, one after the other."""
    return [mode.value for mode, _ in groupby(tick.mode for tick in ticks)]


def test_a_paths_duration_is_that_of_the_longest_travel() -> None:
    """A travel of one radian has pi/2 rad/s in the middle of the path, and 1 rad/s on average."""
    path = PosePath([np.array([0.0, 0.0]), np.array([0.25, 1.0])], [np.pi / 2])
    assert path.duration_s == pytest.approx(1.0)
    np.testing.assert_allclose(path.at(0.5), [0.125, 0.5])
    assert (path.at(0.501) - path.at(0.499))[1] / 0.002 == pytest.approx(np.pi / 2, rel=1e-4)


def test_a_robot_lies_if_its_base_has_no_clearance(go1: Robot) -> None:
    """In the crouch the clearance is 48 % smaller than while standing."""
    postures = Postures(go1, CONFIG, lie_down=True)
    for pose, on_legs in ((go1.lying_pose + 0.05, False), (np.tile([0.0, 1.2, -2.4], 4), True)):
        postures.stand_up(pose, np.array([1.0, 0.0, 0.0, 0.0]))
        assert postures.on_legs(0.0, Mode.STANDING) is on_legs


def test_feet_reach_ground_fast(go1: Robot) -> None:
    """Legs are stretched by 0.3 rad. From the default pose a calf moves by 0.9 rad to lying."""
    for before, share, rate_rad_s in ((MotionBefore.STOPPED, 0.0, 8.0), (MotionBefore.WALKING, 0.7, 12.0)):
        postures = Postures(go1, CONFIG, lie_down=True)
        postures.lie_down(go1.default_pose + np.tile([0, 0, 0.3], 4), before)
        fast_s = 0.5 * np.pi * (0.3 + share * 0.9) / rate_rad_s
        slow_s = 0.5 * np.pi * (1.0 - share) * 0.9 / CONFIG.pose_rate_rad_s
        between = (1.0 - share) * go1.default_pose + share * go1.lying_pose
        np.testing.assert_allclose(postures.command(fast_s).position, between, atol=1e-9)
        assert not postures.done(fast_s + slow_s + 0.29 * CONFIG.stand_s)
        assert postures.done(fast_s + slow_s + 0.3 * CONFIG.stand_s)


class TestRun:
    def test_a_run_from_lying_to_disabled_motors(self, go1: Robot) -> None:
        outcome, ticks = run(go1, Hold(go1))
        first, walking, last = ticks[0], next(t for t in ticks if t.mode is Mode.WALKING), ticks[-1]
        assert modes(ticks) == ["IDLE", "STANDING", "WALKING", "STOPPING", "LOWERING", "RELEASING"]
        assert (outcome.final_state, outcome.faults) == ("IDLE", ())
        assert max(first.height_m, last.height_m) < go1.legs.base_below + 0.01
        assert walking.height_m > 0.9 * go1.description.standing_height_m
        rates = [
            np.abs(after.target - before.target).max() * QUICK.joint_rate_hz / QUICK.pose_rate_rad_s
            for before, after in pairwise(ticks)
            if before.mode in HELD and after.mode in (Mode.STANDING, Mode.LOWERING)
        ]
        assert 0.9 < max(rates) < 1.01
        assert max(tick.tilt_rad for tick in ticks) < 0.1
        released = [tick.height_m for tick in ticks if tick.mode is Mode.RELEASING]
        assert np.ptp(released) < 0.01  # nothing drops

    def test_a_policy_that_fails_at_top_speed_leaves_the_robot_on_its_belly(self, go1: Robot) -> None:
        """The kinetic energy would lift the robot by 0.17 m and turn it over if its feet stopped."""
        policy = InjectingPolicy(load_policy("go1-flat", go1))

        def fail(loop: ControlLoop) -> None:
            if loop.walking and loop.walking_s > 1.2:
                policy.change_decision = not_a_number

        settings = {"lying": False, "config": DeployConfig(stand_s=0.2), "duration_s": 3.0}
        _, ticks = run(go1, policy, fail, command_source=lambda _: np.array([1.8, 0.0, 0.0]), **settings)
        assert modes(ticks)[2:] == ["WALKING", "LOWERING", "ESTOP"]
        assert max(tick.tilt_rad for tick in ticks if tick.mode is Mode.LOWERING) < 0.8
        assert ticks[-1].tilt_rad < 0.1
        assert ticks[-1].height_m < go1.legs.base_below + 0.01

    def test_a_robot_stops_before_it_lies_down(self, go1: Robot) -> None:
        policy = Hold(go1)
        run(go1, policy, lying=False, command_source=lambda _: np.array([0.5, 0.0, 0.1]))
        commands = [seen.command.tolist() for seen in policy.seen]
        # The policy runs at 50 Hz: at 0 to 0.1 s while walking, then for 0.1 s while stopping.
        assert commands == [[0.5, 0.0, 0.1]] * 6 + [[0.0] * 3] * 5

    def test_a_robot_without_a_lying_pose_cannot_begin_in_it(self) -> None:
        with pytest.raises(UserError, match=r"'g1'.*lying_rad"):
            run(G1, Hold(G1))

    def test_a_biped_that_stands_up_does_not_tip_over_its_toes(self) -> None:
        """The centre of mass differs from the model's: without levelling the biped tips over."""
        sample = {"com_offset_m": np.array([0.03, 0.0, 0.01]), "payload_kg": 4.0}
        episode = Episode(lambda _: np.zeros(3), duration_s=1.2, sample=sample)
        assert not run_episode(G1, load_policy("step", G1), episode).fell

    def test_a_biped_comes_to_rest(self) -> None:
        """The biped has gyro noise, the bus's delays, and stiff joints such as those of a Talos."""
        rates: list[float] = []
        config = replace(deploy_config(G1), stand_kp_scale=8.0)
        episode = Episode(lambda _: np.zeros(3), 0.05, noise=Noise(gyro=0.02), config=config)
        policy = load_policy("stand", G1)
        run_episode(G1, policy, episode, lambda _, body: rates.append(float(body.data.qvel[4])))
        assert np.abs(rates[400:500]).max() < 0.2

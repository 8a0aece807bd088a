"""Getting up after a fall: first a fake robot made of frames, then the simulated robot."""

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from deploy_policies import Hold, short_episode
from frame_robot import FrameRobot
from loops import loop_of, until

from footfall import JointCommand, PolicyInput, Robot, run_episode
from footfall.deploy.command_source import Behaviour, Request, Stop
from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.deploy.recovery import GetUp
from footfall.deploy.recovery_config import RecoveryConfig
from footfall.deploy.replay import replay
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.plant.robot import SimulatedRobot

QUICK = RecoveryConfig(tries=2, try_s=0.5, unfold_s=0.0, wait_s=2.0, rest_s=0.1, stand_s=0.1)
# The fake robot turns at once: its gyro and its acceleration do not follow.
NO_IMU_CHECKS = SensorLimits(
    rotation_rad=6.0, rest_error=2.0, lateral_error=2.0, long_lateral_error=2.0, lift_error=2.0
)
SAFETY = SafetyConfig(damping_s=0.1, recovery=QUICK, sensors=NO_IMU_CHECKS)
ON_ITS_SIDE, UPRIGHT = (math.cos(0.7), math.sin(0.7), 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)


class Rise(Hold):
    """Folds the legs, then stretches them."""

    name = "rise"

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self._folded = robot.lying_pose

    def reset(self, inputs: PolicyInput) -> None:
        super().reset(inputs)
        self._found = inputs.sensed.joint_position.copy()

    def act(self, inputs: PolicyInput) -> JointCommand:
        folded, risen = np.clip([inputs.time_s, inputs.time_s - 1.0], 0.0, 1.0)
        position = (1.0 - folded) * self._found + (folded - risen) * self._folded + risen * self._pose
        return super().act(inputs)._replace(position=position)


def ahead() -> Any:
    """A command source that always requests to walk ahead."""
    request = Request(np.array([0.2, 0.0, 0.0]), Behaviour.WALK)
    return SimpleNamespace(poll=Mock(return_value=request), stopped=None)


def fallen(robot: Robot, walked: bool = True, **more: Any) -> tuple[ControlLoop, FrameRobot, Hold, Hold]:
    """A loop whose robot walked or lies from the start on its side; its policy, and the get-up policy."""
    walking, rising = Hold(robot), Hold(robot)
    rising.name = "rising"
    loop, body = loop_of(robot, walking, get_up=rising, safety=SAFETY, **more)
    if walked:
        until(loop, Mode.WALKING)
    body.quaternion = ON_ITS_SIDE
    until(loop, Mode.FALLING if walked else Mode.RECOVERING)
    return loop, body, walking, rising


def to_the_end(loop: ControlLoop) -> list[Mode]:
    """Tick until the run is over; the modes on the way."""
    modes = [loop.state.mode]
    while loop.tick():
        if loop.state.mode is not modes[-1]:
            modes.append(loop.state.mode)
    return modes


FAULTS: dict[str, Callable[[FrameRobot, ControlLoop, Any], object]] = {
    "silent IMU": lambda body, *_: setattr(body, "imu_silent", True),
    "silent motor": lambda body, *_: setattr(body, "silent", [4]),
    "hot motor": lambda body, *_: setattr(body, "temperature_c", 95),
    "motor error": lambda body, *_: body.error.__setitem__(3, 1),
    "stop": lambda _body, _loop, source: setattr(source, "stopped", Stop("stopped by x")),
    "end": lambda _body, loop, _source: loop.finish(),
}


class TestOnFrames:
    def test_a_robot_gets_up_stands_and_walks_on_under_the_policy_that_walked(self, go1: Robot) -> None:
        loop, body, walking, rising = fallen(go1, command_source=(source := ahead()))
        until(loop, Mode.RECOVERING)
        assert loop.recovery.recovered == []
        body.quaternion = UPRIGHT
        until(loop, Mode.WALKING)
        assert (loop.state.faults, walking.resets, rising.resets) == ((), 2, 1)
        assert (walking.seen[-1].time_s, walking.seen[-1].command.tolist()) == (0.0, [0.2, 0.0, 0.0])
        assert not any(each.command.any() for each in rising.seen)
        (recovered,) = loop.recovery.recovered
        assert ("tilt" in recovered.fault, recovered.tries) == (True, 1)
        assert source.poll.call_args.args[0].notes
        loop.finish()
        to_the_end(loop)
        assert loop.walked_s < loop.now_us * 1e-6 - (recovered.stood_s - recovered.fell_s)

    def test_after_all_tries_the_robot_stays_down(self, go1: Robot) -> None:
        loop, *_, rising = fallen(go1)
        assert to_the_end(loop) == [Mode.FALLING, Mode.RECOVERING] * 2 + [Mode.FALLING]
        assert (rising.resets, len(loop.state.faults)) == (2, 3)  # the fall, and each try

    def test_a_robot_that_lies_from_the_start_gets_up_too(self, go1: Robot) -> None:
        loop, body, walking, rising = fallen(go1, walked=False)
        body.quaternion = UPRIGHT
        until(loop, Mode.WALKING)
        assert (rising.resets, walking.resets) == (1, 1)
        loop.finish()
        to_the_end(loop)
        assert 0.0 < loop.walked_s < 1.5

    @pytest.mark.parametrize("fault", FAULTS)
    @pytest.mark.parametrize("mode", [Mode.RECOVERING, Mode.FALLING])
    def test_a_fault_while_getting_up_keeps_it_down(self, go1: Robot, fault: str, mode: Mode) -> None:
        final, source = Mode.FALLING if fault == "end" else Mode.ESTOP, ahead()
        loop, body, *_ = fallen(go1, command_source=source)
        until(loop, mode)
        FAULTS[fault](body, loop, source)
        modes = to_the_end(loop)
        assert Mode.RECOVERING not in modes[1:]
        assert modes[-1] in (final, Mode.FALLING)
        if mode is Mode.RECOVERING:
            assert modes == [mode, final]
        assert not body.sent[-5][1].values[2].any()  # damped, before the motors are disabled

    def test_a_policy_that_fails_does_not_get_another_try(self, go1: Robot) -> None:
        loop, *_, rising = fallen(go1)
        rising.act = lambda inputs: 1 / 0  # type: ignore[method-assign, assignment, return-value]
        assert to_the_end(loop) == [Mode.FALLING, Mode.ESTOP]


class TipOver:
    """Tips the walking robot over, then puts it on its belly with folded legs."""

    def __init__(self, robot: Robot) -> None:
        self._lying, self._tipped, self.modes = robot.lying_pose, False, list[Mode]()

    def __call__(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        mode = loop.state.mode
        if not self.modes or mode is not self.modes[-1]:
            self.modes.append(mode)
        if mode is Mode.WALKING and loop.walking_s > 0.2 and not self._tipped:
            self._tipped = True
            body.data.qvel[2:4] = 1.0, 12.0
        since_s = loop.now_us * 1e-6 - loop.state.since_s
        if mode is Mode.FALLING and 0.0 < since_s < 0.01:
            body.data.qpos[2:7], body.data.qpos[7:] = (0.15, *UPRIGHT), self._lying
            body.data.qvel[:] = 0.0


def test_a_simulated_robot_gets_up_and_its_log_replays_to_the_bit(go1: Robot, tmp_path: Path) -> None:
    config = DeployConfig(stand_s=0.4, odometry=True, joint_rate_hz=250.0)
    log, watch, rise = tmp_path / "run.mcap", TipOver(go1), GetUp(Rise(go1), "rise")
    episode = short_episode(duration_s=5.0, get_up=rise, log=log, config=config, lie_down=True)
    trace = run_episode(go1, Hold(go1), episode, watch)
    assert trace.faults == (), (watch.modes, trace.faults, trace.run_s)
    assert (trace.fell, len(trace.recoveries)) == (False, 1)
    stands = [Mode.STANDING, Mode.WALKING]
    ends = [Mode.STOPPING, Mode.LOWERING, Mode.RELEASING]
    assert watch.modes[1:] == [*stands, Mode.FALLING, Mode.RECOVERING, *stands, *ends]
    assert 0.0 < trace.walked_s < 3.5
    again = replay(log, Hold(go1), get_up=Rise(go1))
    assert (again.worst_difference, again.first_difference) == (0.0, "")
    assert np.diff(trace.time_s).max() > 1.0  # nothing is sampled while it lies
    standing = trace.time_s > trace.time_s[-1] - 0.5
    np.testing.assert_allclose(trace.estimated_velocity[standing], 0.0, atol=0.05)
    np.testing.assert_allclose(trace.estimated_height[standing], trace.base_position[standing, 2], atol=0.03)

"""Signals for the supervisor: conditions that prevent stiffness, late ticks, gaps of the IMU, health."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold
from frame_robot import TICK_US, FrameRobot
from loops import loop_of, until
from some_motors import frame

from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.driver import Motors, Replies
from footfall.deploy.drivers.imu import ImuReader
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.deploy.pose import impossible_pose
from footfall.deploy.receiver import Receiver
from footfall.deploy.skipped_ticks import SkippedTicks
from footfall.deploy.timing import Durations
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.motor_end import Request
from footfall.robots.description import Robot


def refused(loop: ControlLoop, body: FrameRobot) -> tuple[str, ...]:
    """The faults of a run in which no joint ever gets stiffness."""
    while loop.tick():
        assert loop.state.mode in (Mode.IDLE, Mode.ESTOP)
        assert Request.COMMAND not in body.kinds() or not body.sent[-1][1].values[2].any()
    assert loop.state.mode is Mode.ESTOP
    return loop.state.faults


def test_a_first_position_may_be_off_by_whole_turns_alone(go1: Robot) -> None:
    """The joint's range is 1 to 2 rad; the others are in the default pose."""
    labels = [f"joint {joint}" for joint in range(12)]
    lower, upper, pose = go1.lower_rad.copy(), go1.upper_rad.copy(), go1.default_pose.copy()
    lower[4], upper[4] = 1.0, 2.0
    robot = replace(go1, lower_rad=lower, upper_rad=upper)
    for position, turns in (
        (1.5 + math.tau, "+1 turn of the joint (+6.28 rad)"),
        (1.95 + math.tau, "+1 turn of the joint (+6.28 rad)"),
        (1.5 + 2 * math.tau, "+2 turns of the joint (+12.57 rad)"),
        (1.5 - math.tau, "-1 turn of the joint (-6.28 rad)"),
        *((off, "") for off in (2.05 + math.tau, 0.95 - math.tau, math.nan, math.inf)),  # beside the range
    ):
        pose[4] = position
        fault = impossible_pose(robot, labels, pose, 0.0)
        assert fault.startswith("joint 4 reads")
        assert turns in fault
        assert ("of the joint" in fault) is bool(turns)
    # With a gear ratio of 6.33 a turn of the rotor is 0.99 rad, less than the first joint's range of 1.7 rad.
    pose, turn_rad = go1.default_pose.copy(), math.tau / go1.motor_figures("gear_ratio")[0]
    pose[0] = go1.upper_rad[0] + 0.5
    fault = impossible_pose(go1, labels, pose, 0.1)
    assert fault.endswith(f"off by +1 turn of its rotor (+{turn_rad:.2f} rad)?")


def test_an_impossible_position_prevents_stiffness(go1: Robot) -> None:
    for joint, turns in ((3, 1), (3, -1), (10, 1), (10, -1)):
        loop, body = loop_of(go1, Hold(go1))
        body.readings[0, joint] += turns * math.tau
        (fault,) = refused(loop, body)
        assert fault.startswith(body.wiring.label(joint))
        assert f"{turns:+} turn " in fault


@pytest.mark.parametrize("query", ["not_ready", "not_enabled"])
def test_no_joint_gets_stiffness_before_each_motor_is_ready_and_enabled(go1: Robot, query: str) -> None:
    """All motors reply meanwhile. At the end the fault is the driver's."""
    driver = open_driver(wiring_of(go1))
    setattr(driver, query, lambda: "motor knee is not there yet")
    assert refused(*loop_of(go1, Hold(go1), driver=driver)) == ("motor knee is not there yet",)


def test_motors_are_enabled_until_all_have_answered(go1: Robot) -> None:
    loop, body = loop_of(go1, Hold(go1))
    body.silent = [3]
    for _ in range(5):
        loop.tick()
        assert body.kinds() == [Request.ENABLE] * 12
    assert loop.state.mode is Mode.IDLE
    body.silent = []
    loop.tick()
    assert loop.state.mode is Mode.STANDING


def test_the_share_of_skipped_ticks_fades() -> None:
    """Of the last second a pause of 60 ms skips 58 ms, one of 2 ms none, and one of 2 s all."""
    skipped = SkippedTicks(TICK_US)
    shares = [skipped.share(elapsed_us) for elapsed_us in (TICK_US, 60_000, TICK_US, 0, 2_000_000)]
    assert shares == pytest.approx([0.0, 0.058, 0.058 * 0.998, 0.058 * 0.998, 0.999])


def test_the_last_durations_are_kept_in_order_and_the_longest_always() -> None:
    durations = Durations(capacity=4)
    for values in ([9.0, 1.0, 2.0], [3.0, 4.0, 5.0, 6.0]):
        for value in values:
            durations.add(value)
        assert durations.values().tolist() == values
    assert (durations.count, durations.longest) == (7, 9.0)


@pytest.mark.parametrize(("silent_ticks", "compared"), [(0, True), (15, False)])
def test_a_gap_of_the_imu_is_not_compared_across(go1: Robot, silent_ticks: int, compared: bool) -> None:
    """The base turns by 0.3 rad, which the gyro does not report, at once or within 30 ms of silence."""
    loop, body = loop_of(go1, Hold(go1))
    until(loop, Mode.WALKING)
    body.imu_silent = silent_ticks > 0
    for _ in range(silent_ticks):
        loop.tick()
    body.imu_silent, body.quaternion = False, (math.cos(0.15), 0.0, 0.0, math.sin(0.15))
    for _ in range(50):
        loop.tick()
    assert bool(loop.state.faults) is compared


def test_readings_and_health_are_of_each_motor_and_copies() -> None:
    """Motors replied at 1, 2 and 3 ms; at 20 ms the IMU has sent nothing."""
    driver: Any = SimpleNamespace()
    receiver = Receiver(driver, ImuReader(0), 3)

    def absorb(motor: Motors, temperature_c: list[float], voltage: list[float], at_us: list[int]) -> None:
        k, rest = len(voltage), map(np.array, (temperature_c, voltage, at_us))
        driver.replies = lambda _: Replies(motor, np.zeros((3, k)), np.full(k, 3), *rest)
        receiver.absorb([frame(1, b"")], max(at_us) + 1000)

    absorb(slice(None), [50.0, 51.0, 52.0], [24.0, 25.0, 26.0], [1000, 2000, 3000])
    before, health = (receiver.temperature_c, receiver.voltage), receiver.health(20_000)
    np.testing.assert_allclose(health.age_s[:3], [0.019, 0.018, 0.017])
    assert (health.age_s[3] > 1e6, health.error.tolist()) == (True, [3, 3, 3])
    absorb(np.array([1]), [30.0], [np.nan], [4000])
    for earlier in (before, (health.temperature_c, health.voltage)):
        assert [part.tolist() for part in earlier] == [[50.0, 51.0, 52.0], [24.0, 25.0, 26.0]]
    assert receiver.temperature_c.tolist() == [50.0, 30.0, 52.0]
    np.testing.assert_array_equal(receiver.voltage, [24.0, np.nan, 26.0])

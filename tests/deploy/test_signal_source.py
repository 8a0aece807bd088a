"""Conditions that prevent stiffness, and the count of late ticks: see `signal_source`."""

import math

import pytest
from deploy_policies import Hold
from frame_robot import TICK_US, FrameRobot
from loops import loop_of, until

from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.deploy.skipped_ticks import SkippedTicks
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


@pytest.mark.parametrize("joint", [3, 10])
@pytest.mark.parametrize("turns", ["+1 turn ", "-1 turn "])
def test_an_impossible_position_prevents_stiffness(go1: Robot, joint: int, turns: str) -> None:
    loop, body = loop_of(go1, Hold(go1))
    body.readings[0, joint] += math.copysign(math.tau, float(turns.split(maxsplit=1)[0]))
    (fault,) = refused(loop, body)
    assert fault.startswith(body.wiring.label(joint))
    assert turns in fault


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
    """A pause of 60 ms skips 58 ms of the last second; one of 2 ms skips none.

    One of 2 s skips the whole second.
    """
    skipped = SkippedTicks(TICK_US)
    shares = [skipped.share(elapsed_us) for elapsed_us in (TICK_US, 60_000, TICK_US, 0, 2_000_000)]
    assert shares == pytest.approx([0.0, 0.058, 0.058 * 0.998, 0.058 * 0.998, 0.999])


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

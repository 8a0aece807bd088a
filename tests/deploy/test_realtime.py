"""Runs that keep to the wall clock: on the simulated bus, and on python-can's buses without hardware."""

from dataclasses import replace
from functools import partial
from typing import Any

import pytest
from deploy_policies import FailingPolicy, Hold, short_episode, slow, stand_still
from multicast import robot_on_multicast
from relaxed_limits import RELAXED

from footfall import Robot, run_episode
from footfall.deploy.session import Session, run_on_interface

UNHURRIED = replace(RELAXED, joint_rate_hz=100.0, stand_s=0.4)
SHORT = Session(stand_still, 0.4, config=UNHURRIED, lie_down=False)


class TestSimulatedBus:
    def test_keeps_to_the_wall_clock(self, go1: Robot) -> None:
        trace = run_episode(go1, Hold(go1), short_episode(duration_s=0.5, realtime=True, config=UNHURRIED))
        assert trace.final_state == "IDLE"
        assert trace.wall_s >= trace.run_s - 0.01  # later on a busy machine, never earlier
        assert trace.run_s >= 0.4 + 0.5 + 0.5  # stand, walk, damp
        assert trace.timing["lateness_us_max"] >= trace.timing["lateness_us_p50"] > 0.0

    @pytest.mark.parametrize(
        ("limit", "seconds", "message"),
        [
            ({"late_limit_s": 0.1}, 0.15, "ran late: no decision within 100 ms"),
            ({"late_steps": 5}, 0.03, "5 steps in a row"),
        ],
    )
    def test_late_policies(self, go1: Robot, limit: dict[str, Any], seconds: float, message: str) -> None:
        config = replace(UNHURRIED, safety=replace(RELAXED.safety, **limit))
        policy = FailingPolicy(go1, 0.1, partial(slow, seconds=seconds))
        trace = run_episode(go1, policy, short_episode(duration_s=20.0, realtime=True, config=config))
        assert trace.final_state == "ESTOP"
        assert message in trace.faults[0]


class TestPythonCan:
    def test_the_robot_walks_over_multicast_from_another_process(self, go1: Robot) -> None:
        with robot_on_multicast("--duration", "600", "--motor-timeout", f"{RELAXED.motor_timeout_s:g}"):
            outcome = run_on_interface(go1, Hold(go1), "udp_multicast", SHORT)
        assert outcome.faults == ()
        assert outcome.final_state == "IDLE"
        assert all(bus.frames_received >= 3 for bus in outcome.buses)

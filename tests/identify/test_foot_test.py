"""The test of one foot: positions in the air, and forces on a scale."""

import json
from pathlib import Path

import numpy as np
import pytest

from footfall.cli import main
from footfall.deploy.config import DeployConfig
from footfall.identify.foot_test import FootTest, FootTestConfig, Hold, Measurement, press_findings, presses
from footfall.identify.record import run_on_stand
from footfall.identify.simulated import on_scales
from footfall.robots.description import Robot

QUICK = FootTestConfig(settle_s=0.3, move_s=0.3, hold_s=0.2, press_s=0.3)
RL = 3


@pytest.mark.parametrize(("strength", "findings"), [(1.0, 0), (0.5, 1)])
def test_a_scale_shows_the_missing_force_of_weak_motors(go1: Robot, strength: float, findings: int) -> None:
    share = np.ones(len(go1.joint_names))
    share[go1.foot_joints[RL]] = strength
    scales = on_scales(go1, {"motor_strength": share})
    loop = DeployConfig(joint_rate_hz=250.0, stand_s=0.1)
    policy = FootTest(go1, RL, presses(go1, QUICK), QUICK, loop.joint_rate_hz, lambda: scales.weigh(RL))
    duration_s = policy.duration_s + 0.5
    run_on_stand(go1, policy, scales.bus, duration_s, loop, False, done=lambda: policy.done)
    assert len(press_findings(policy.measured, QUICK)) == findings
    # These motors report their true torque.
    assert [each.scale_n for each in policy.measured] == pytest.approx(
        [each.force_n for each in policy.measured], abs=0.5
    )


def test_motors_that_report_twice_their_torque_are_found() -> None:
    """The scale shows a preload of 3 N and half of the reported force, or all of it."""
    place = np.zeros(3)
    for share, findings in ((0.5, 2), (1.0, 0)):
        measured = [Measurement(Hold(place, n, 1.0), place, n, share * n + 3.0) for n in (10.0, 20.0)]
        assert len(press_findings(measured, FootTestConfig(presses=(0.1, 0.2)))) == findings


def test_the_foot_of_a_simulated_robot_reaches_all_positions(tmp_path: Path) -> None:
    motion, found = tmp_path / "motion.yaml", tmp_path / "found.json"
    motion.write_text("{settle_s: 0.3, move_s: 0.2, hold_s: 0.1, reach_m: 0.04}")
    assert main(["identify", "foot", "FL", "--motion", str(motion), "--json", str(found)]) == 0
    measured = json.loads(found.read_text())["held"]
    commanded, reached = (
        np.array([each[key] for each in measured]) for key in ("commanded_offset_m", "offset_m")
    )
    assert np.abs(commanded).sum() == pytest.approx(6 * 0.04)
    assert reached == pytest.approx(commanded, abs=0.001)

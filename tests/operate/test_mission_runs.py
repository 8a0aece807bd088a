"""A mission on the simulated robot, in lockstep."""

import math
from dataclasses import replace

import numpy as np
import pytest

from footfall import Episode, Robot, load_policy, run_episode
from footfall.common.rotations import heading, heading_matrix, wrap_angle
from footfall.deploy.config import deploy_config
from footfall.operate.abilities import abilities_of
from footfall.operate.missions.mission import mission_of
from footfall.operate.missions.source import MissionSource


def test_a_mission_steers_the_robot_and_ends_the_run(go1: Robot) -> None:
    policy = load_policy("go1-flat", go1)
    steps = [{"go_to": {"to": [0.3, 0.0], "heading_deg": 30.0}}]
    mission = mission_of({"speed_m_s": 0.5, "steps": steps, "tracking": {"tolerance_m": 0.03}}, "mission")
    source = MissionSource(mission, policy.name, abilities_of({"go1-flat": policy}, go1))
    episode = Episode(source, 30.0, config=replace(deploy_config(go1), odometry=True), record_rate_hz=10.0)
    trace = run_episode(go1, policy, episode)
    assert (source.progress.done, trace.final_state, trace.fell) == (True, "IDLE", False)
    assert source.progress.error_m <= 0.03
    assert trace.walked_s < 5.0
    first, last = trace.base_quaternion[0], trace.base_quaternion[-1]
    moved = heading_matrix(-float(heading(first))) @ (trace.base_position[-1] - trace.base_position[0])
    assert np.linalg.norm(moved[:2] - (0.3, 0.0)) < 0.06
    assert math.degrees(wrap_angle(float(heading(last)) - float(heading(first)))) == pytest.approx(
        30.0, abs=6.0
    )

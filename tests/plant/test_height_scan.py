"""The simulated robot's height scans, and a policy that uses them on the simulated bus."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from deploy_policies import short_episode
from tiny_policy import write_network

from footfall import Robot, Trace, run_episode
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.deploy.replay import replay
from footfall.domain_rand.height_scan import HeightScanErrors
from footfall.plant.height_scan import SimulatedScanner
from footfall.plant.robot import SimulatedRobot
from footfall.policies.contract import Contract, Term
from footfall.policies.height_scan import HeightScan
from footfall.policies.learned import LearnedPolicy
from footfall.policies.observation import observation_size
from footfall.terrain.declaration import load_ground
from footfall.terrain.ground import Ground

onnx = pytest.importorskip("onnx")
SCAN = HeightScan()
SLOPE = Ground(0.1 * np.arange(201)[None, :, None] * 0.05 + np.zeros((1, 201, 201)), np.array([False]), 0.05)
YAW = 0.4
POSE = np.array([0.3, -0.2, 0.9]), np.array([np.cos(YAW / 2), 0.0, 0.0, np.sin(YAW / 2)])


def scanner(errors: HeightScanErrors | None = None, ground: Ground | None = SLOPE) -> SimulatedScanner:
    return SimulatedScanner(SCAN, errors or HeightScanErrors(), ground, lambda: POSE, 7)


def test_heights_are_those_of_the_ground_above_the_base() -> None:
    scanned = scanner().newest(1_000_000)
    assert scanned is not None
    x = POSE[0][0] + np.cos(YAW) * SCAN.points[:, 0] - np.sin(YAW) * SCAN.points[:, 1]
    np.testing.assert_allclose(scanned.heights, 0.1 * (x + 5.0) - 0.9, atol=1e-9)
    flat = scanner(ground=None).newest(0)
    assert flat is not None
    np.testing.assert_allclose(flat.heights, -0.9)


def test_scans_arrive_at_their_rate_and_after_their_lag() -> None:
    late = scanner(HeightScanErrors(lag_s=(0.06, 0.06)))
    taken = [found.taken_us if (found := late.newest(now)) else None for now in range(0, 240_000, 20_000)]
    assert taken[:3] == [None, None, None]
    assert taken[3:] == np.repeat([0, 40_000, 80_000, 120_000, 160_000], 2).tolist()[:9]


@pytest.fixture
def seeing(tmp_path: Path, contract: Contract, go1: Robot) -> LearnedPolicy:
    """A policy that holds the default pose, with an offset from the height scan."""
    reads = replace(contract, observation=(Term("height_scan"), Term("gyro")))
    weights = np.zeros((observation_size(reads), 12), np.float32)
    weights[:84] = 1e-4
    return LearnedPolicy(write_network(onnx, tmp_path / "seeing.onnx", weights, reads), go1)


def walked(go1: Robot, policy: LearnedPolicy, **settings: object) -> tuple[Trace, np.ndarray]:
    """A short run on stairs, and the heights that the policy observed, (steps, points + 1)."""
    observed = []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.state.mode is Mode.WALKING:
            observed.append(policy.observed[:85])

    ground = load_ground("stairs,step_m=0.1,start_m=0.6")
    episode = short_episode(duration_s=0.8, ground=ground, **settings)
    return run_episode(go1, policy, episode, watch), np.array(observed)


def test_a_policy_sees_the_stairs_ahead(go1: Robot, seeing: LearnedPolicy) -> None:
    trace, observed = walked(go1, seeing)
    assert (trace.final_state, trace.notes) == ("IDLE", ())
    heights = observed[-1][:-1].reshape(12, 7)
    np.testing.assert_allclose(heights[4], -go1.description.standing_height_m, atol=0.05)
    np.testing.assert_allclose(heights[-1] - heights[4], 0.1, atol=0.01)
    assert observed[-1][-1] == 1.0


def test_a_log_with_scans_replays_to_the_bit(go1: Robot, seeing: LearnedPolicy, tmp_path: Path) -> None:
    log = tmp_path / "run.mcap"
    walked(go1, seeing, log=log, height_scan_errors=HeightScanErrors(lag_s=(0.05, 0.05), noise_m=0.02))
    found = replay(log, seeing)
    assert (found.steps > 30, found.first_difference) == (True, "")

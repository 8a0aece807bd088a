"""Step responses, and the search for the gains at which a joint rings."""

import json
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from footfall.deploy.config import DeployConfig
from footfall.identify.gain_search import GainConfig, Gains, GainSearch, Response, Tuned, response_of, search
from footfall.identify.record import run_on_stand
from footfall.identify.simulated import simulated_bus
from footfall.robots.description import load_robot

CONFIG = GainConfig()
TIME_S = np.linspace(0.0, 3.0, 1501)
CALM, RINGING = Response(0.05, 0.0, False), Response(0.05, 0.5, True)


def second_order(damping: float) -> Response:
    """The response of a mass on a spring to a step of -0.05 rad."""
    rad_s, step = 20.0, -0.05
    swing = rad_s * math.sqrt(1.0 - damping**2)
    decay = np.exp(-damping * rad_s * TIME_S)
    shape = 1.0 - decay * (np.cos(swing * TIME_S) + damping * rad_s / swing * np.sin(swing * TIME_S))
    return response_of(TIME_S, step * shape, np.gradient(step * shape, TIME_S), step, CONFIG)


@pytest.mark.parametrize("damping", [0.2, 0.4, 0.7])
def test_overshoot_and_rise_are_those_of_a_second_order_system(damping: float) -> None:
    found = second_order(damping)
    assert found.overshoot == pytest.approx(
        math.exp(-math.pi * damping / math.sqrt(1 - damping**2)), abs=0.01
    )
    rise = 1.76 * damping**3 - 0.417 * damping**2 + 1.039 * damping + 1.0  # Nise, Control Systems Engineering
    assert found.rise_s == pytest.approx(rise / 20.0, rel=0.05)
    assert not found.rings


def test_a_lasting_oscillation_and_a_large_error_are_ringing_and_no_motion_has_no_rise_time() -> None:
    assert second_order(0.01).rings
    assert response_of(TIME_S, TIME_S, np.ones_like(TIME_S), 0.05, CONFIG).rings
    assert math.isnan(response_of(TIME_S, 0.0 * TIME_S, 0.0 * TIME_S, 0.05, CONFIG).rise_s)


def searched(rings: Callable[[Gains], bool], config: GainConfig = CONFIG) -> tuple[Tuned, list[Gains]]:
    """The result for a joint that rings at some gains, and the gains that were tried."""
    trials = search(config)
    tried = [next(trials)]
    while True:
        try:
            tried.append(trials.send(RINGING if rings(tried[-1]) else CALM))
        except StopIteration as end:
            return end.value, tried


def test_gains_are_raised_until_the_joint_rings_and_then_lowered_and_otherwise_stay() -> None:
    tuned, tried = searched(lambda gains: gains.kp > 3.0 or gains.kd > 2.0)
    assert tuned.kp_rings == pytest.approx(1.25**5)
    assert tuned.kd_rings == pytest.approx(1.25**4)
    assert tuned.proposed == pytest.approx((0.8 * 1.25**5, 0.8 * 1.25**4))
    steps = [after.kp / before.kp for before, after in pairwise(tried)]
    assert max(steps) <= 1.25 + 1e-9
    lowered, _ = searched(lambda gains: gains.kp > 0.6)  # the own gains ring
    assert (lowered.kp_rings, lowered.proposed.kp) == pytest.approx((0.64, 0.512))
    own, tried = searched(lambda gains: False)
    assert (own.kp_rings, own.kd_rings, own.proposed) == (None, None, Gains())
    assert max(gains.kp for gains in tried) <= CONFIG.max_gain


def test_a_run_is_long_enough_for_joints_that_ring_at_every_gain_which_must_be_reduced() -> None:
    config = GainConfig(backoff=0.9)
    _, tried = searched(lambda gains: True, config)
    joint_s = len(tried) * (config.trial_s + config.settle_s)
    assert GainSearch(load_robot("go1"), config, 500.0).duration_s > 3 * joint_s
    with pytest.raises(ValueError, match="backoff"):
        GainConfig(backoff=1.0)


def test_a_joint_with_a_slow_motor_rings_on_the_robot() -> None:
    robot = load_robot("go1")
    slow = np.zeros(12)
    slow[0] = 0.02
    quick = GainConfig(settle_s=0.3, trial_s=0.3, max_gain=2.0)
    policy, config = GainSearch(robot, quick, 250.0), DeployConfig(joint_rate_hz=250.0, stand_s=0.1)
    bus = simulated_bus(robot, {"torque_lag_s": slow})
    outcome = run_on_stand(
        robot, policy, bus, policy.duration_s, config, realtime=False, done=lambda: policy.done
    )
    assert (outcome.final_state, outcome.faults) == ("IDLE", ())
    assert len(policy.tuned) == 12
    # Of the two front hips, the first one rings.
    assert [policy.tuned[joint].kp_rings is None for joint in (0, 3)] == [False, True]


def test_the_command_writes_each_joints_gains(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "steps.yaml").write_text("{settle_s: 0.2, trial_s: 0.2, max_gain: 1.3}")
    result = shell("identify", "gains", "--steps", tmp_path / "steps.yaml", "--json", tmp_path / "gains.json")
    assert result.status == 0, result
    found = json.loads((tmp_path / "gains.json").read_text())
    assert set(found) == set(load_robot("go1").joint_names)
    assert all(each["own"]["rise_s"] > 0.0 for each in found.values())

"""Scores of one episode."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from traces import walk

from footfall.evaluate.metrics import score
from footfall.robots.description import Robot


def test_an_emergency_stop_counts_as_a_fall(go1: Robot) -> None:
    metrics = score(replace(walk(), final_state="ESTOP"), go1, 125.0)
    assert (metrics.fell, metrics.emergency_stop) == (True, True)


@pytest.mark.filterwarnings("error")
def test_a_fall_at_the_start_scores_nothing_else(go1: Robot) -> None:
    for seconds in (0.0, 0.01, 0.5):
        metrics = score(replace(walk(seconds), fell=True), go1, 125.0)
        assert (metrics.fell, metrics.scored_s) == (True, 0.0)
        assert np.isnan([metrics.lin_vel_mse, metrics.estimate_mse]).all()


def test_sway_within_a_stride_does_not_count_as_distance(go1: Robot) -> None:
    straight = walk(5.0)
    swaying = straight.base_position.copy()
    swaying[:, 1] += 0.02 * np.sin(2 * np.pi * 4.0 * straight.time_s)
    distance_m = score(replace(straight, base_position=swaying), go1, 125.0).distance_m
    assert distance_m == pytest.approx(5.0, rel=1e-2)


def test_each_score_is_computed_from_its_own_signal(go1: Robot) -> None:
    """The scores of a trace with different numbers in all fields equal plain sums."""
    rng = np.random.default_rng(3)
    count, rate_hz = 700, 50.0
    draws: dict[str, Any] = {
        "command": np.repeat(rng.normal(size=(2, 3)), [300, 400], axis=0),
        "base_velocity": rng.normal(size=(count, 3)),
        "base_angular_velocity": rng.normal(size=(count, 3)),
        "motor_torque": rng.normal(size=(count, 12)) * np.arange(1, 13),
        "joint_target": rng.normal(size=(count, 12)), "foot_velocity": rng.normal(size=(count, 4, 3)),
        "foot_contact": rng.random((count, 4)) < [0.2, 0.4, 0.6, 0.8],
        "estimated_velocity": rng.normal(size=(count, 3)), "electrical_power": rng.random(count),
        "mechanical_power": rng.random(count), "positive_power": rng.random(count),
        "base_position": np.outer(np.arange(count), [0.02, -0.015, 0.3]),
    }  # fmt: skip
    trace = replace(walk(7.0), time_s=np.arange(count) / rate_hz, record_rate_hz=rate_hz, **draws)
    found = score(trace, go1, 77.0)
    settled = np.r_[50:300, 350:700]
    assert (found.fell, found.emergency_stop, found.weight_n) == (False, False, 77.0)
    assert (found.scored_s, found.walked_s) == pytest.approx((600 / rate_hz, 14.0))
    fields = ("command", "base_velocity", "base_angular_velocity")
    command, linear, angular = (draws[name][settled] for name in fields)
    assert found.lin_vel_mse == pytest.approx(np.mean(np.sum((command - linear)[:, :2] ** 2, axis=1)))
    assert found.yaw_rate_mse == pytest.approx(np.mean((command[:, 2] - angular[:, 2]) ** 2))
    assert found.mean_velocity == pytest.approx([*linear[:, :2].mean(axis=0), angular[:, 2].mean()])
    off = draws["estimated_velocity"][settled, :2] - linear[:, :2]
    assert found.estimate_mse == pytest.approx(np.mean(np.sum(off**2, axis=1)))
    energies = (found.electrical_j, found.mechanical_j, found.positive_j)
    powers = ("electrical_power", "mechanical_power", "positive_power")
    assert energies == pytest.approx([draws[name].sum() / rate_hz for name in powers])
    torque = np.abs(draws["motor_torque"])
    assert found.peak_torque_nm == pytest.approx(torque.max())
    assert found.peak_torque_share == pytest.approx((torque.max(axis=0) / go1.motor.peak_torque).max())
    assert found.stance_s == pytest.approx(draws["foot_contact"].sum() / rate_hz)
    speeds = np.hypot(draws["foot_velocity"][..., 0], draws["foot_velocity"][..., 1])
    assert found.foot_slip_m_s == pytest.approx(speeds[draws["foot_contact"]].mean())
    for name, rate in (("joint_target", found.target_rate_rad_s), ("motor_torque", found.torque_rate_nm_s)):
        assert rate == pytest.approx(np.sqrt(np.mean((np.diff(draws[name], axis=0) * rate_hz) ** 2)))
    assert found.distance_m == pytest.approx(699 * 0.025, rel=0.05)

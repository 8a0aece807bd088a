"""Scores of one episode."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from traces import walk

from footfall.evaluate.metrics import score, settled_samples
from footfall.robots.description import Robot


class TestTracking:
    def test_a_robot_that_does_as_told_has_no_error(self, go1: Robot) -> None:
        metrics = score(walk(), go1, 125.0)
        assert metrics.lin_vel_mse == metrics.yaw_rate_mse == 0.0
        assert metrics.mean_velocity == pytest.approx((1.0, 0.0, 0.0))
        assert not metrics.fell

    @given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
    def test_velocity_error_is_the_length_of_both_axes_together(
        self, go1: Robot, forward: float, left: float, yaw: float
    ) -> None:
        trace = walk()
        wrong = replace(
            trace,
            base_velocity=trace.base_velocity + np.array([forward, left, 0.7]),
            base_angular_velocity=trace.base_angular_velocity + np.array([0.7, 0.7, yaw]),
        )
        metrics = score(wrong, go1, 125.0)
        assert np.sqrt(metrics.lin_vel_mse) == pytest.approx(np.hypot(forward, left))
        assert np.sqrt(metrics.yaw_rate_mse) == pytest.approx(abs(yaw))

    def test_the_first_second_after_each_change_does_not_count(self, go1: Robot) -> None:
        trace = walk(6.0)
        command = trace.command.copy()
        command[300:] = [0.0, 0.5, 0.0]
        velocity = command * [1.0, 1.0, 0.0]
        velocity[:100] += 1.0
        velocity[300:400] += 1.0
        late_to_follow = replace(trace, command=command, base_velocity=velocity)
        assert score(late_to_follow, go1, 125.0).lin_vel_mse == 0.0
        velocity[400] += 1.0
        assert score(replace(late_to_follow, base_velocity=velocity), go1, 125.0).lin_vel_mse > 0.0

    def test_settled_time_is_what_remains_after_each_second(self) -> None:
        trace = walk(6.0)
        command = trace.command.copy()
        command[300:] = 0.0
        settled = settled_samples(replace(trace, command=command))
        assert settled.sum() == 200 + 200
        assert not settled[:100].any()
        assert not settled[300:400].any()

    def test_estimates_are_scored_where_somebody_estimates(self, go1: Robot) -> None:
        trace = walk()
        assert np.isnan(score(trace, go1, 125.0).estimate_mse)
        estimating = replace(trace, estimated_velocity=trace.base_velocity + np.array([0.03, 0.04, 9.0]))
        assert np.sqrt(score(estimating, go1, 125.0).estimate_mse) == pytest.approx(0.05)


class TestEndings:
    def test_an_emergency_stop_counts_as_a_fall(self, go1: Robot) -> None:
        metrics = score(replace(walk(), final_state="ESTOP"), go1, 125.0)
        assert metrics.fell
        assert metrics.emergency_stop

    @pytest.mark.filterwarnings("error")
    @pytest.mark.parametrize("seconds", [0.0, 0.01, 0.5])
    def test_who_falls_at_once_scores_nothing_but_the_fall(self, go1: Robot, seconds: float) -> None:
        metrics = score(replace(walk(seconds), fell=True), go1, 125.0)
        assert metrics.fell
        assert metrics.scored_s == 0.0
        assert np.isnan(metrics.lin_vel_mse)


class TestEffort:
    def test_sway_within_a_stride_is_no_distance(self, go1: Robot) -> None:
        straight = walk(5.0)
        swaying = straight.base_position.copy()
        swaying[:, 1] += 0.02 * np.sin(2 * np.pi * 4.0 * straight.time_s)
        distance = score(replace(straight, base_position=swaying), go1, 125.0).distance_m
        assert distance == pytest.approx(score(straight, go1, 125.0).distance_m, rel=1e-2)
        assert distance == pytest.approx(5.0, rel=1e-2)

    def test_peak_torque_is_held_against_each_motors_own_limit(self, go1: Robot) -> None:
        torque = np.zeros((500, 12))
        torque[10, 0] = -0.9 * go1.motor.peak_torque[0]
        torque[20, 2] = 0.7 * go1.motor.peak_torque[2]
        metrics = score(replace(walk(), motor_torque=torque), go1, 125.0)
        assert metrics.peak_torque_share == pytest.approx(0.9)
        assert metrics.peak_torque_nm == pytest.approx(0.7 * go1.motor.peak_torque[2])

    def test_only_feet_on_the_ground_slip_and_only_sideways(self, go1: Robot) -> None:
        trace = walk()
        velocity, contact = trace.foot_velocity.copy(), trace.foot_contact.copy()
        velocity[..., 2] = 5.0
        velocity[:, 0, 0] = 0.2
        velocity[:, 1, 0] = 3.0
        contact[:, 1] = False
        metrics = score(replace(trace, foot_velocity=velocity, foot_contact=contact), go1, 125.0)
        assert metrics.foot_slip_m_s == pytest.approx(0.2 / 3)
        assert metrics.stance_s == pytest.approx(15.0)


class TestScore:
    """A trace whose numbers all differ, against plain sums."""

    def test_every_score_is_of_its_own_signal(self, go1: Robot) -> None:
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
        assert found.scored_s == pytest.approx(600 / rate_hz)
        assert found.walked_s == pytest.approx(14.0)
        command, linear, angular = (
            draws[n][settled] for n in ("command", "base_velocity", "base_angular_velocity")
        )
        assert found.lin_vel_mse == pytest.approx(np.mean(np.sum((command - linear)[:, :2] ** 2, axis=1)))
        assert found.yaw_rate_mse == pytest.approx(np.mean((command[:, 2] - angular[:, 2]) ** 2))
        assert found.mean_velocity == pytest.approx([*linear[:, :2].mean(axis=0), angular[:, 2].mean()])
        off = draws["estimated_velocity"][settled, :2] - linear[:, :2]
        assert found.estimate_mse == pytest.approx(np.mean(np.sum(off**2, axis=1)))
        energies = (found.electrical_j, found.mechanical_j, found.positive_j)
        powers = ("electrical_power", "mechanical_power", "positive_power")
        assert energies == pytest.approx([draws[name].sum() / rate_hz for name in powers])
        assert found.weight_n == 77.0
        torque = np.abs(draws["motor_torque"])
        assert found.peak_torque_nm == pytest.approx(torque.max())
        assert found.peak_torque_share == pytest.approx((torque.max(axis=0) / go1.motor.peak_torque).max())
        assert found.stance_s == pytest.approx(draws["foot_contact"].sum() / rate_hz)
        speeds = np.hypot(draws["foot_velocity"][..., 0], draws["foot_velocity"][..., 1])
        assert found.foot_slip_m_s == pytest.approx(speeds[draws["foot_contact"]].mean())
        for name, rate in (
            ("joint_target", found.target_rate_rad_s),
            ("motor_torque", found.torque_rate_nm_s),
        ):
            assert rate == pytest.approx(np.sqrt(np.mean((np.diff(draws[name], axis=0) * rate_hz) ** 2)))
        assert found.distance_m == pytest.approx(699 * 0.025, rel=0.05)

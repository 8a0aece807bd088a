"""Figures of standing, from an invented trace."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.plant import standing
from footfall.plant.standing import standing_test
from footfall.robots.description import Robot


def stood(
    monkeypatch: pytest.MonkeyPatch, robot: Robot, **changes: Any
) -> tuple[standing.StandingResult, Any]:
    """The result of four samples, and the requested episode. The second half counts as settled."""
    height = robot.description.standing_height_m
    turns = Rotation.from_euler("xyz", [[0, 0, 0], [0.3, 0, 2.0], [0, -0.1, 0], [0, 0, 0]])
    torque = np.zeros((4, 12))
    torque[:, 0], torque[:, 1] = (-20.0, 1.0, -6.0, 3.0), (9.0, 9.0, 2.0, 4.0)
    facts = {
        "time_s": np.arange(4) / 100.0,
        "base_position": np.add([5, 7, height], [[0, 0, 0], [0.3, 0.4, -0.05], [0, 0, 0.2], [0, 0, 0]]),
        "base_quaternion": turns.as_quat(scalar_first=True),
        "foot_contact": np.array([[0, 0, 0, 0], [0, 0, 0, 0], [1, 1, 0, 1], [1, 0, 0, 1]], dtype=bool),
        "motor_torque": torque,
        "fall_reason": "",
        "fell": False,
        "faults": (),
        "walked_s": 0.04,
    }  # fmt: skip
    calls = []

    def run_episode(robot: Robot, policy: Any, episode: Any) -> Any:
        calls.append((policy, episode))
        return SimpleNamespace(**facts | changes)

    monkeypatch.setattr(standing, "run_episode", run_episode)
    return standing_test(robot, duration_s=2.5, seed=9), calls[0]


@pytest.fixture
def strong(go1: Robot) -> Robot:
    """go1 with motors that stall at more than their current limit allows."""
    return replace(
        go1, motor=go1.motor._replace(peak_torque=np.full(12, 10.0), stall_torque=np.full(12, 40.0))
    )


def test_sinking_and_tilt_are_the_largest_of_all_samples(
    monkeypatch: pytest.MonkeyPatch, strong: Robot
) -> None:
    found, (_, episode) = stood(monkeypatch, strong)
    assert (found.sank_m, found.tilt_rad, found.moved_m) == pytest.approx((0.05, 0.3, 0.5))
    assert found.stood_s == 0.04
    assert (episode.duration_s, episode.seed) == (2.5, 9)
    assert not np.any(episode.command_source(1.0))


def test_torques_and_contacts_after_settling(monkeypatch: pytest.MonkeyPatch, strong: Robot) -> None:
    found, _ = stood(monkeypatch, strong)
    assert found.torque_share[:3] == pytest.approx([0.6, 0.4, 0.0])
    assert found.feet_down.tolist() == [1.0, 0.5, 0.0, 1.0]


@pytest.mark.parametrize(
    ("changes", "reason", "is_up"),
    [
        ({}, "", True),
        ({"fall_reason": "it lies down", "fell": True}, "it lies down", False),
        ({"fell": True}, "the simulation diverged", False),
        ({"faults": ("no reply",)}, "", False),
    ],
)
def test_a_robot_stood_if_it_neither_fell_nor_had_a_fault(
    monkeypatch: pytest.MonkeyPatch, strong: Robot, changes: dict, reason: str, is_up: bool
) -> None:
    found, _ = stood(monkeypatch, strong, **changes)
    assert (found.fall_reason, found.stood) == (reason, is_up)

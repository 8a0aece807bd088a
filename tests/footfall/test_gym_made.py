"""Environments registered with gymnasium, and their arguments; none is made here."""

from typing import Any

import gymnasium
import pytest

import footfall.gym
from footfall.robots.description import Robot, available_robots
from footfall.train.config import load_preset


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Requested environments: kind, robot, settings and the rest."""
    calls: list[Any] = []
    for kind in ("GymnasiumEnv", "GymnasiumVectorEnv"):
        monkeypatch.setattr(
            f"footfall.envs.gymnasium_env.{kind}", lambda *given, kind=kind: calls.append((kind, *given))
        )
    return calls


def test_each_shipped_robot_has_its_environments() -> None:
    ids = {"g1": "G1", "go1": "Go1", "hexapod": "Hexapod"}
    assert set(ids) == set(available_robots())
    registered = {name: spec for name, spec in gymnasium.registry.items() if name.startswith("footfall/")}
    assert {name: spec.kwargs for name, spec in registered.items()} == {
        f"footfall/{title}Velocity-v0": {"robot": robot} for robot, title in ids.items()
    }
    for spec in registered.values():
        assert spec.entry_point == "footfall.gym:make_single"
        assert spec.vector_entry_point == "footfall.gym:make_vector"


def test_options_reach_the_environment_with_its_robots_settings(
    made: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[Any] = []

    def smoke(preset: str, robot: Robot) -> Any:
        read.append((preset, robot.name))
        return load_preset("smoke")

    monkeypatch.setattr(footfall.gym, "load_preset", smoke)
    footfall.gym.make_single("hexapod", "mine.yaml", "mjx", "rgb_array")
    footfall.gym.make_vector("hexapod", 7, "mine.yaml", "mjx", "rgb_array")
    assert read == [("mine.yaml", "hexapod")] * 2
    (_, robot, config, mode), (_, many_robot, many_config, count, many_mode) = made
    assert (robot.name, many_robot.name) == ("hexapod", "hexapod")
    assert config == many_config
    assert (config.physics, config.episode_s) == ("mjx", load_preset("smoke").env.episode_s)
    assert (mode, count, many_mode) == ("rgb_array", 7, "rgb_array")

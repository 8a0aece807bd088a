"""The Python API: names of `import footfall`, and environments registered with gymnasium."""

from typing import Any

import gymnasium
import pytest

import footfall.gym
from footfall.robots.description import Robot, available_robots
from footfall.train.config import load_preset


def test_the_api_has_exactly_the_documented_names() -> None:
    assert all(getattr(footfall, name) is not None for name in footfall.__all__)
    assert set(footfall.__all__) <= set(dir(footfall))
    assert not hasattr(footfall, "load_robots")


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


def test_options_reach_the_environment_with_its_robots_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[Any] = []
    smoke = load_preset("smoke")

    def load(preset: str, robot: Robot) -> Any:
        read.append((preset, robot.name))
        return smoke

    monkeypatch.setattr(footfall.gym, "load_preset", load)
    for kind in ("GymnasiumEnv", "GymnasiumVectorEnv"):
        monkeypatch.setattr(f"footfall.envs.gymnasium_env.{kind}", lambda *given: given)
    robot, config, *options = footfall.gym.make_single("hexapod", "mine.yaml", "mjx", "rgb_array")
    many_robot, many_config, *many = footfall.gym.make_vector("hexapod", 7, "mine.yaml", "mjx", "rgb_array")
    assert read == [("mine.yaml", "hexapod")] * 2
    assert (robot.name, many_robot.name) == ("hexapod", "hexapod")
    assert config == many_config
    assert (config.physics, config.episode_s) == ("mjx", smoke.env.episode_s)
    assert (options, many) == (["rgb_array"], [7, "rgb_array"])

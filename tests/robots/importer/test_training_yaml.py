"""The training.yaml and randomisation.yaml of an imported robot."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from foreign_robots import BIPED_MJCF, make, quadruped, read

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import default_ranges, load_randomisation, randomisation_of
from footfall.policies.gaits import gaits_of
from footfall.robots.commands import CommandRange
from footfall.robots.importer.build import build_machine
from footfall.robots.importer.machine import Machine
from footfall.robots.importer.pose import Pose
from footfall.robots.importer.randomisation_yaml import randomisation_yaml
from footfall.robots.importer.training_yaml import training_yaml
from footfall.train.config import available_presets, load_preset


def machine_of(tmp_path: Path, mass: float) -> Machine:
    """A quadruped of that mass."""
    machine, _ = build_machine(read(tmp_path, quadruped()), "dog", ())
    links = tuple(replace(link, mass=link.mass * mass / machine.mass) for link in machine.links)
    return replace(machine, links=links)


def pose_of(reach_m: float) -> Pose:
    return Pose({}, 0.3, 0.0, reach_m)


def test_figures_scale_with_leg_length_and_mass(tmp_path: Path) -> None:
    commands = CommandRange((-1.0, 1.5), (-0.5, 0.5), (-0.8, 0.8))
    env = yaml.safe_load(training_yaml(machine_of(tmp_path, 39.0), pose_of(1.8), commands, "trot"))["env"]
    assert env["gait"]["frequency_hz"] == pytest.approx(1.1)  # twice the time for a step
    assert env["rewards"]["torque"] == pytest.approx(-1.2e-3 / 144, rel=0.05)  # squared torque: (3 * 4)^2
    assert env["rewards"]["power"] == pytest.approx(-6.8e-3 / 6, rel=0.05)  # torque 12 times, rates a half
    assert env["rewards"]["swing_height"]["height_m"] == pytest.approx(0.32)
    assert env["rewards"]["crowded_feet"] == pytest.approx({"weight": -40.0 / 16, "distance_m": 0.48})


def test_loads_scale_with_the_mass_and_offsets_with_the_legs(tmp_path: Path) -> None:
    default = load_randomisation()
    same_size, larger = (
        yaml.safe_load(randomisation_yaml(machine_of(tmp_path, mass), pose_of(reach_m), default_ranges()))
        for mass, reach_m in ((13.0, 0.45), (39.0, 1.8))
    )
    for name in ("payload_kg", "com_offset_m"):
        assert Distribution(**same_size[name]) == getattr(default, name)
    assert larger == {"payload_kg": {"low": -3.0, "high": 6.0}, "com_offset_m": {"low": -0.12, "high": 0.12}}


def test_quantities_without_a_range_are_left_out(tmp_path: Path) -> None:
    """With legs of twice the reach, the centre of mass may be off by 0.02 m, and there is no load."""
    text = randomisation_yaml(machine_of(tmp_path, 13.0), pose_of(0.9), {"com_offset_m": (0.0, 0.02)})
    assert yaml.safe_load(text) == {"com_offset_m": {"low": 0.0, "high": 0.04}}


@pytest.mark.parametrize(("text", "gait"), [(quadruped(), "trot"), (BIPED_MJCF, "walk")])
def test_every_preset_loads_with_an_imported_robots_training_yaml(
    tmp_path: Path, text: str, gait: str
) -> None:
    robot, _ = make(tmp_path, text, defaults=default_ranges(), gaits_of=gaits_of)
    forward_m_s = robot.description.commands.forward_m_s[1]
    for preset in available_presets():
        config = load_preset(preset, robot)
        env = config.env
        if not config.training_yaml:
            assert env.gait is None
            continue
        assert env.gait is not None
        assert env.gait.name == gait
        assert env.commands.ranges.forward_m_s[1] == pytest.approx(1.2 * forward_m_s, rel=0.05)
        assert 0.0 > env.weights["torque"] > -1.0
        assert env.weights["alive"] > 0.0  # the rest is the preset's
        if env.randomisation.payload_kg is not None:
            assert env.randomisation.payload_kg == randomisation_of(robot).payload_kg

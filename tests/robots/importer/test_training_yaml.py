"""The training.yaml and randomisation.yaml of an imported robot."""

import dataclasses
from pathlib import Path

import pytest
import yaml
from foreign_robots import BIPED_MJCF, make, quadruped

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import default_ranges, load_randomisation, randomisation_of
from footfall.policies.gaits import gaits_of
from footfall.robots.importer.build import build_machine
from footfall.robots.importer.machine import Machine
from footfall.robots.importer.pose import Pose
from footfall.robots.importer.randomisation_yaml import randomisation_yaml
from footfall.robots.importer.read import read_source
from footfall.train.config import available_presets, load_preset


def machine_of(tmp_path: Path, mass: float) -> Machine:
    """A quadruped of that mass."""
    (tmp_path / "dog.urdf").write_text(quadruped())
    machine, _ = build_machine(read_source(tmp_path / "dog.urdf", ()), "dog", ())
    heavier = mass / machine.mass
    links = tuple(dataclasses.replace(link, mass=link.mass * heavier) for link in machine.links)
    return dataclasses.replace(machine, links=links)


def ranges_of(machine: Machine, reach_m: float) -> dict[str, dict]:
    return yaml.safe_load(randomisation_yaml(machine, Pose({}, 0.3, 0.0, reach_m), default_ranges()))


def test_loads_scale_with_the_mass_and_offsets_with_the_legs(tmp_path: Path) -> None:
    default = load_randomisation()
    same_size = ranges_of(machine_of(tmp_path, 13.0), 0.45)
    for name in ("payload_kg", "com_offset_m"):
        assert Distribution(**same_size[name]) == getattr(default, name)
    assert ranges_of(machine_of(tmp_path, 39.0), 1.8) == {
        "payload_kg": {"low": -3.0, "high": 6.0},
        "com_offset_m": {"low": -0.12, "high": 0.12},
    }


def test_quantities_without_a_range_are_left_out(tmp_path: Path) -> None:
    """With legs of twice the reach, the centre of mass may be off by 0.02 m, and there is no load."""
    pose = Pose({}, 0.3, 0.0, 0.9)
    text = randomisation_yaml(machine_of(tmp_path, 13.0), pose, {"com_offset_m": (0.0, 0.02)})
    assert yaml.safe_load(text) == {"com_offset_m": {"low": 0.0, "high": 0.04}}


@pytest.mark.parametrize(
    ("text", "suffix", "gait"), [(quadruped(), "urdf", "trot"), (BIPED_MJCF, "xml", "walk")]
)
def test_every_preset_loads_with_an_imported_robots_training_yaml(
    tmp_path: Path, text: str, suffix: str, gait: str
) -> None:
    robot, _ = make(tmp_path, text, suffix, defaults=default_ranges(), gaits_of=gaits_of)
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

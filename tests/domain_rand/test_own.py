"""A robot's own randomisation.yaml, and the presets and scenarios that use it."""

from dataclasses import replace
from pathlib import Path

from refused import refusal_of

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import load_randomisation, own_ranges, randomisation_of
from footfall.robots.description import Robot, load_robot
from footfall.train.config import load_preset

OWN = "payload_kg: {low: -0.1, high: 0.3}\ncom_offset_m: {high: 0.01}\n"


def own_robot(folder: Path, text: str) -> Robot:
    (folder / "randomisation.yaml").write_text(text)
    return load_robot(folder)


def test_a_robots_file_replaces_only_its_own_quantities(own_folder: Path) -> None:
    robot = own_robot(own_folder, OWN)
    payload, offset = Distribution(-0.1, 0.3), Distribution(-0.03, 0.01)
    assert randomisation_of(robot) == replace(load_randomisation(), payload_kg=payload, com_offset_m=offset)
    assert own_ranges(robot) == {"payload_kg": payload, "com_offset_m": offset}


def test_a_malformed_file_is_refused_in_one_line(own_folder: Path) -> None:
    for text, named in (
        ("load_kg: {low: 0, high: 1}", "load_kg"),
        ("payload_kg: {low: 3.0}", "payload_kg"),
        ("- 1", "mapping"),
    ):
        robot = own_robot(own_folder, text)
        for read in (randomisation_of, lambda robot: load_preset("cpu", robot)):
            _, _, complaint = refusal_of(read, robot).partition("randomisation.yaml over ")
            assert named in complaint


def test_presets_take_the_robots_ranges_for_quantities_that_they_randomise(own_folder: Path) -> None:
    robot = own_robot(own_folder, OWN)
    trained, shipped = load_preset("cpu", robot).env.randomisation, load_preset("cpu").env.randomisation
    assert trained == replace(shipped, payload_kg=Distribution(-0.1, 0.3))
    assert shipped.com_offset_m is None
    assert load_preset("smoke", robot) == load_preset("smoke")


def test_a_robots_training_yaml_overrides_its_ranges(own_folder: Path) -> None:
    (own_folder / "training.yaml").write_text("env: {randomisation: {payload_kg: {low: 0.0, high: 0.1}}}")
    assert load_preset("cpu", own_robot(own_folder, OWN)).env.randomisation.payload_kg == Distribution(
        0.0, 0.1
    )

"""A robot's own randomisation.yaml, and the presets and scenarios that use it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import load_randomisation, own_ranges, randomisation_of
from footfall.evaluate.episodes import sample_of
from footfall.evaluate.plan import EpisodePlan, plan_episodes
from footfall.evaluate.scenarios import load_scenarios
from footfall.robots.description import Robot, load_robot
from footfall.train.config import load_preset

OWN = "payload_kg: {low: -0.1, high: 0.3}\ncom_offset_m: {high: 0.01}\n"


def own_robot(folder: Path, text: str) -> Robot:
    (folder / "randomisation.yaml").write_text(text)
    return load_robot(folder)


def randomised_plan(robot: Robot) -> EpisodePlan:
    scenarios = load_scenarios(robot).scenarios
    return plan_episodes("randomised", scenarios["randomised"], 0, 1)[0]


def test_a_robots_file_replaces_only_its_own_quantities(own_folder: Path) -> None:
    robot = own_robot(own_folder, OWN)
    payload, offset = Distribution(-0.1, 0.3), Distribution(-0.03, 0.01)
    assert randomisation_of(robot) == replace(load_randomisation(), payload_kg=payload, com_offset_m=offset)
    assert own_ranges(robot) == {"payload_kg": payload, "com_offset_m": offset}


def test_a_quantity_may_be_left_nominal_and_an_empty_file_changes_nothing(
    own_folder: Path, go1: Robot
) -> None:
    robot = own_robot(own_folder, "payload_kg: null\n")
    assert own_ranges(robot) == {"payload_kg": None}
    assert set(load_scenarios(robot).scenarios["payload"].levels["payload_kg"]) == {
        0.0
    }  # the robot carries none
    for empty in (go1, own_robot(own_folder, ""), own_robot(own_folder, "# nothing yet\n")):
        assert own_ranges(empty) == {}
        assert randomisation_of(empty) == load_randomisation()


def test_a_malformed_file_is_refused_in_one_line(own_folder: Path) -> None:
    for text, named in (
        ("load_kg: {low: 0, high: 1}", "load_kg"),
        ("payload_kg: {low: 3.0}", "payload_kg"),
        ("- 1", "mapping"),
    ):
        robot = own_robot(own_folder, text)
        for read in (randomisation_of, lambda robot: load_preset("cpu", robot)):
            with pytest.raises(UserError, match=rf"randomisation\.yaml over .*{named}") as caught:
                read(robot)
            assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", [None, OWN])
def test_the_scenario_draws_from_its_ranges_with_the_same_random_numbers(
    own_folder: Path, text: str | None
) -> None:
    """Numbers 0 to 14 belong to the friction, the masses of 13 bodies and the payload."""
    robot = load_robot(own_folder) if text is None else own_robot(own_folder, text)
    plan = randomised_plan(robot)
    numbers = np.random.default_rng(plan.seed).random(1000)
    sample = sample_of(plan, robot, 13)
    assert sample is not None
    low, high = (-1.0, 2.0) if text is None else (-0.1, 0.3)
    assert sample["friction"] == pytest.approx(0.4 + 0.85 * numbers[0])
    assert sample["payload_kg"] == pytest.approx(low + (high - low) * numbers[14])


def test_presets_take_the_robots_ranges_for_quantities_that_they_randomise(own_folder: Path) -> None:
    robot = own_robot(own_folder, OWN)
    trained, shipped = load_preset("cpu", robot).env.randomisation, load_preset("cpu").env.randomisation
    assert trained == replace(shipped, payload_kg=Distribution(-0.1, 0.3))
    assert shipped.com_offset_m is None
    assert load_preset("smoke", robot) == load_preset("smoke")


def test_presets_take_quantities_that_only_this_robot_declares(own_folder: Path) -> None:
    """The quantity is one that `footfall identify fit` finds.

    Quantities that no policy reads change only the simulated robot.
    """
    lag, jitter = Distribution(0.002, 0.004), Distribution(0.0, 0.001)
    text = "torque_lag_s: {low: 0.002, high: 0.004}\naction_jitter_s: {low: 0.0, high: 0.001}\n"
    robot = own_robot(own_folder, text + "accelerometer_noise_m_s2: {low: 0.0, high: 0.1}\n")
    trained, shipped = load_preset("gpu", robot).env.randomisation, load_preset("gpu").env.randomisation
    assert trained == replace(shipped, torque_lag_s=lag, action_jitter_s=jitter)


def test_a_robots_training_yaml_overrides_its_ranges(own_folder: Path) -> None:
    (own_folder / "training.yaml").write_text("env: {randomisation: {payload_kg: {low: 0.0, high: 0.1}}}")
    assert load_preset("cpu", own_robot(own_folder, OWN)).env.randomisation.payload_kg == Distribution(
        0.0, 0.1
    )


@pytest.mark.parametrize(
    ("name", "zoo"), [("go1", "go1-flat"), ("hexapod", "hexapod-flat"), ("g1", "g1-flat")]
)
def test_the_gpu_preset_has_the_randomisation_of_the_zoos_policy(name: str, zoo: str) -> None:
    kept = load_preset(str(Path(__file__).parents[2] / "policies" / "zoo" / zoo / "config.yaml"))
    assert load_preset("gpu", load_robot(name)).env.randomisation == kept.env.randomisation

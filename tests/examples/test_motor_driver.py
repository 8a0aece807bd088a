"""The example of a motor driver with its simulated motor."""

import json
import shutil

import numpy as np
import pytest
from user_folder import UserFolder

from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motor_ends.motor_end import Report
from footfall.robots.description import ROBOTS, Robot, load_robot


@pytest.fixture
def robot(user_folder: UserFolder) -> Robot:
    """A user's copy of go1 with the example's motors."""
    for name in ("acme_driver.py", "acme_motor_end.py"):
        user_folder.copy(f"motor_driver/{name}")
    folder = user_folder.path / "my_robot"
    shutil.copytree(ROBOTS / "go1", folder)
    lines = (folder / "robot.yaml").read_text().splitlines()
    indent = "    protocol: "
    changed = [f"{indent}acme_driver:AcmeDriver" if line.startswith(indent) else line for line in lines]
    (folder / "robot.yaml").write_text("\n".join(changed))
    return load_robot(folder)


def test_a_robot_walks_on_the_examples_motors(user_folder: UserFolder, robot: Robot) -> None:
    command = ("--robot", "my_robot", "--command", "0.4,0,0", "--duration", "1.5", "--json", "out.json")
    user_folder.footfall("deploy", "go1-flat", *command)
    figures = json.loads((user_folder.path / "out.json").read_text())
    assert figures["final_state"] == "IDLE"
    assert figures["distance_m"] > 0.3


def test_commands_and_replies_arrive_as_they_were_sent(robot: Robot) -> None:
    wiring = wiring_of(robot)
    driver, end, rng = open_driver(wiring), open_motor_end(wiring), np.random.default_rng(1)
    values = rng.uniform(driver.lowest, driver.highest)
    steps = (driver.highest - driver.lowest) / [[65535], [65535], [255], [255], [65535]]
    received = end.requests(driver.command(values))
    assert np.all(np.abs(received.values - values) <= 0.51 * steps)
    beyond = end.requests(driver.command(2.0 * driver.highest))
    np.testing.assert_allclose(beyond.values, driver.highest)
    measured, error = values[[0, 1, 4]], np.arange(12, dtype=np.uint64)
    replies = driver.replies(end.reply(np.arange(12), Report(measured, error, np.ones(12, bool), 41)))
    assert np.all(np.abs(replies.values - measured) <= 0.51 * steps[[0, 1, 4]])
    np.testing.assert_array_equal(replies.error, error)
    np.testing.assert_array_equal(replies.temperature_c, 41.0)

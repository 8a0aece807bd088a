"""Which hand-written controllers stand or walk on a robot."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from shell import Shell

from footfall.plant.walking import controllers_test
from footfall.robots.description import Robot, load_robot


@pytest.fixture
def with_controllers(go1: Robot, tmp_path: Path) -> Callable[[dict], Robot]:
    """go1 with other settings of its controllers."""

    def make(sections: dict) -> Robot:
        for name in ("robot.yaml", "robot.xml"):
            (tmp_path / name).write_text((go1.folder / name).read_text())
        (tmp_path / "controllers.yaml").write_text(yaml.safe_dump(sections, sort_keys=False))
        return load_robot(tmp_path)

    return make


def test_each_controller_stands_and_walks_or_the_reason_is_named(
    go1: Robot, with_controllers: Callable[[dict], Robot]
) -> None:
    own = yaml.safe_load((go1.folder / "controllers.yaml").read_text())
    crawl = own["trot"] | {"step": own["trot"]["step"] | {"length_m": 0.03}}
    robot = with_controllers(
        {"stand": own["stand"], "mpc": own["mpc"], "trot": crawl, "pace": own["trot"] | {"kp": 3.0}}
    )
    stand, mpc, trot, pace = controllers_test(robot, 2.0)
    assert (stand.outcome, stand.command_m_s, stand.trouble) == ("stands", 0.0, "")
    assert (mpc.outcome, mpc.command_m_s) == ("walks", 0.5)
    assert mpc.speed_m_s == pytest.approx(0.5, abs=0.1)
    assert not trot.trouble
    assert trot.outcome.startswith("walks slowly")
    assert pace.trouble
    assert pace.trace is not None
    assert pace.trace.fell


def test_a_controller_that_refuses_its_settings_fails_alone(
    go1: Robot, with_controllers: Callable[[dict], Robot], shell: Shell
) -> None:
    own = yaml.safe_load((go1.folder / "controllers.yaml").read_text())
    wrong = own["mpc"] | {"rate_hz": 1e30}
    robot = with_controllers({"mpc": wrong, "trot": own["trot"] | {"unheard_of": 1}, "stand": own["stand"]})
    outcome = shell("robot", "check", robot.folder, "--duration", "0.5", "--picture", robot.folder / "p.jpg")
    assert (outcome.status, outcome.err) == (1, "")
    assert re.search(r"^stand +0\.00 .* stands$", outcome.out, re.MULTILINE)
    mpc, trot = [line for line in outcome.out.splitlines() if line.startswith("wrong: ")]
    assert "rate_hz" in mpc
    assert "unheard_of" in trot
    assert (robot.folder / "p.jpg").is_file()


def test_an_unknown_controller_is_refused_before_anything_is_simulated(
    with_controllers: Callable[[dict], Robot], shell: Shell
) -> None:
    assert "'trott'" in shell.refuses("robot", "check", with_controllers({"trott": {}}).folder)

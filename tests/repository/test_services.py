"""Units, images and the compose file: tools accept them, and the command lines in them are footfall's."""

import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from footfall.cli import app
from footfall.deploy.config import deploy_config
from footfall.robots.description import load_robot

SERVICES = Path(__file__).parents[2] / "services"
COMPOSE = SERVICES / "docker" / "compose.yaml"
UNIT = (SERVICES / "systemd" / "footfall.service").read_text()
ENVIRONMENT = dict(
    line.split("=", 1)
    for line in (SERVICES / "systemd" / "robot.env").read_text().splitlines()
    if line and not line.startswith("#")
)


def filled_in(text: str, values: dict[str, str]) -> str:
    """A text with its variables' values, or the defaults that compose files give."""
    return re.sub(r"\$\{?(\w+)(?::-([^}]*))?\}?", lambda m: values.get(m[1], m[2] or ""), text)


def compose() -> dict[str, Any]:
    return yaml.safe_load(filled_in(COMPOSE.read_text(), {}))["services"]


def test_command_lines_can_be_parsed() -> None:
    [started] = re.findall(r"^ExecStart=\S+/footfall (.*)$", UNIT, re.MULTILINE)
    of_containers = [compose()[name]["command"] for name in ("controller", "cockpit")]
    for words in (shlex.split(filled_in(started, ENVIRONMENT)), *of_containers):
        app.parse_args(words, exit_on_error=False, print_error=False)


def test_settings_in_the_service_file_are_valid() -> None:
    config = deploy_config(load_robot(ENVIRONMENT["ROBOT"]), SERVICES / "systemd" / "deploy.yaml")
    assert config.realtime_priority is not None


def test_no_robot_stands_up_by_itself() -> None:
    """A robot starts neither at boot nor after a fault."""
    assert re.findall(r"^Restart=(.*)$", UNIT, re.MULTILINE) == ["no"]
    assert "[Install]" not in UNIT.splitlines()
    assert [name for name, service in compose().items() if service.get("restart", "no") != "no"] == []


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="no systemd")
def test_systemd_accepts_the_units(tmp_path: Path) -> None:
    for path in (SERVICES / "systemd").glob("*.service"):
        text = path.read_text().replace("/opt/footfall/bin/footfall", "/bin/true")
        (tmp_path / path.name).write_text(re.sub(r"/usr/sbin/ip\b", "/bin/true", text))
    shutil.copy(tmp_path / "footfall-can@.service", tmp_path / "footfall-can@can0.service")
    for name in ("footfall.service", "footfall-can@can0.service"):
        command = ["systemd-analyze", "verify", "--man=no", tmp_path / name]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        complaints = [line for line in done.stderr.splitlines() if "footfall" in line]
        assert (complaints, done.returncode) == ([], 0)


@pytest.mark.skipif(
    "BUILD_IMAGES" not in os.environ, reason="BUILD_IMAGES=1 builds images with Docker: minutes"
)
def test_the_compose_file_builds_and_its_robot_walks() -> None:
    """The services end with the controller; the exit status is the run's."""
    command = ["docker", "compose", "--file", str(COMPOSE)]
    up = [*command, "up", "--build", "--exit-code-from", "controller", "robot", "controller"]
    try:
        subprocess.run(up, env=os.environ | {"DURATION": "5"}, check=True, timeout=1200)
    finally:
        subprocess.run([*command, "down", "--volumes"], check=False, timeout=60)

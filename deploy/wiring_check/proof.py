"""Remembers on this computer which wiring has passed the check: a file per robot and kind of bus.

The files are in `$XDG_STATE_HOME/footfall/wiring`, by default `~/.local/state/footfall/wiring`. They apply to
the machine on this computer's buses, not to the robot's folder, which several machines may share.
"""

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

import numpy as np

from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.common.user_folders import state_home
from footfall.deploy.wiring import wiring_of
from footfall.deploy.wiring_check.verdict import Verdict
from footfall.robots.description import Robot

Choice = Literal["auto", "check", "trust"]
SIMULATED = ("sim", "virtual")  # kinds of buses with a simulated robot in this process


def wiring_digest(robot: Robot, bus: str) -> str:
    """Fingerprint of a robot's description, the buses and ids of its motors and IMU, and the kind of bus."""
    facts = {"robot": robot.digest, "bus": bus} | asdict(wiring_of(robot))
    text = json.dumps(facts, sort_keys=True, default=_as_list)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def proof_file(robot: Robot, bus: str) -> Path:
    """The file with the proof. Raises UserError if the user has no folder for it."""
    return state_home() / "footfall" / "wiring" / f"{robot.name}.{bus}.json"


def is_proven(robot: Robot, bus: str) -> bool:
    """Whether this wiring has passed the check on this computer."""
    try:
        saved = json.loads(proof_file(robot, bus).read_text(encoding="utf-8"))
    except (OSError, ValueError, UserError):
        return False
    return isinstance(saved, dict) and saved.get("digest") == wiring_digest(robot, bus)


def keep_proof(robot: Robot, bus: str, verdicts: Sequence[Verdict]) -> str:
    """Save that a wiring has passed the check; returns a note: the file, or the reason for a failure."""
    try:
        path = proof_file(robot, bus)
    except UserError as error:
        return f"the wiring is right, but this cannot be saved: {error}"
    content = {
        "digest": wiring_digest(robot, bus),
        "checked": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        "joint_error": max(verdict.joint_error for verdict in verdicts),
        "imu_error": max(verdict.imu_error for verdict in verdicts),
    }
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, (json.dumps(content, indent=2) + "\n").encode())
    except OSError as error:
        return f"the wiring is right, but this cannot be saved in {path}: {error.strerror}"
    return f"the wiring is right: saved in {path}"


def must_check(robot: Robot, bus: str, choice: Choice) -> bool:
    """Whether a run has to check its wiring first.

    Raises:
        UserError: it has to, but this robot cannot be checked.
    """
    needed = choice == "check" or (choice == "auto" and bus not in SIMULATED and not is_proven(robot, bus))
    if needed and robot.description.held_start:
        raise UserError(
            f"{robot.name} cannot stand still, so its wiring cannot be checked:"
            " add --wiring trust to run it with unproven wiring"
        )
    return needed


def unproven_note(robot: Robot, bus: str) -> str:
    """Note for a run with unchecked wiring; empty for proven wiring or a simulated robot."""
    if bus in SIMULATED or is_proven(robot, bus):
        return ""
    return f"the wiring of {robot.name} on {bus} is not proven: omit --wiring trust to have it checked"


def _as_list(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be stored as JSON")

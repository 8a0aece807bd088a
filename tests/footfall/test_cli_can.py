"""`footfall can` on a simulated robot: output, questions, refusals."""

import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from edited import content_of
from shell import Shell

from footfall.deploy import bench, scan
from footfall.deploy.clock import LockstepClock
from footfall.deploy.drivers import odrive, robstride
from footfall.deploy.wiring import wiring_of
from footfall.plant import serve
from footfall.plant.robot import SimulatedRobot
from footfall.robots.description import Robot


def rows_of(shell: Shell, *tokens: str | Path) -> list[list[str]]:
    """The rows of a successful call on a simulated robot, without the header."""
    outcome = shell("can", *tokens, "--bus", "virtual")
    assert (outcome.status, outcome.err) == (0, ""), outcome
    return [line.split() for line in outcome.out.splitlines()[1:]]


class Turns:
    """Robot and host take turns: the robot's time advances only while the host waits for its next tick."""

    def __init__(self) -> None:
        self._asked, self._passed = threading.Semaphore(0), threading.Semaphore(0)
        self._left_us = 0  # of the requested time

    def ask(self, us: int) -> None:
        """Host: wait until the robot's time has advanced by this much."""
        self._left_us = us
        self._asked.release()
        assert self._passed.acquire(timeout=60.0), "the simulated robot does not run"

    def live(self, us: int) -> None:
        """Robot: wait for a request unless some of its time is left; without one, time is slow."""
        if self._left_us > 0:
            self._left_us -= us
            if self._left_us > 0:
                return
            self._passed.release()
        self._asked.acquire(timeout=0.02)


class TurnsClock(LockstepClock):
    """The clock of the robot or of the host: each tick is a turn."""

    def __init__(self, turn: Callable[[int], None], period_us: int) -> None:
        super().__init__(period_us)
        self._begin_turn = partial(turn, period_us)

    def next_tick(self) -> int:
        self._begin_turn()
        return super().next_tick()


VICTIM, JOINT = 11, "RL_calf_joint"


def inject(monkeypatch: pytest.MonkeyPatch, fault: str, code: int) -> None:
    """Give a motor of the simulated robot a fault from the start."""

    def robot(*arguments: Any) -> SimulatedRobot:
        body = SimulatedRobot(*arguments)
        getattr(body.faults.motors, fault)[VICTIM] = code
        return body

    monkeypatch.setattr(serve, "SimulatedRobot", robot)


class TestVirtual:
    """A bus within this process, with a simulated robot on it."""

    @pytest.fixture(autouse=True)
    def turns(self, monkeypatch: pytest.MonkeyPatch) -> None:
        turns = Turns()
        for module, turn in ((bench, turns.ask), (scan, turns.ask), (serve, turns.live)):
            monkeypatch.setattr(module, "WallClock", partial(TurnsClock, turn))
        # With wall-clock time stamps, frames would be too old whenever a busy machine delays a thread.
        monkeypatch.setattr(serve, "not_before", lambda frames, time_us: frames)

    def test_motors_are_found_watched_enabled_and_set_to_zero(self, shell: Shell) -> None:
        rows = rows_of(shell, "scan")
        assert (len(rows), rows[0]) == (12, ["can0", "1", "MIT", "mode", "FR_hip_joint", "found"])
        assert len(rows_of(shell, "monitor", "--duration", "0.2")) == 12
        (row,) = rows_of(shell, "monitor", "--duration", "0.2", "--joint", JOINT)
        assert row[:4] == [JOINT, "can3", "3", "AK10-9"]
        assert float(row[4]) < -1.5
        assert len(rows_of(shell, "enable", "--duration", "0.2", "--yes")) == 12
        (row,) = rows_of(shell, "zero", "--joint", JOINT, "--yes")
        assert abs(float(row[4])) < 0.05

    def test_a_silent_motor_or_an_error_is_named(self, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
        for verb, fault, code in (("monitor", "silent", 1), ("monitor", "error", 2), ("enable", "error", 2)):
            inject(monkeypatch, fault, code)
            consent = ["--yes"] if verb == "enable" else []
            outcome = shell("can", verb, *consent, "--bus", "virtual", "--duration", "0.2")
            assert outcome.status == 1
            assert JOINT in outcome.out.splitlines()[-1]

    def test_a_latched_error_is_cleared(
        self, shell: Shell, own_folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for protocol, code, message in (
            ("ODrive", odrive.WATCHDOG, "timeout"), ("DM8009", 8, "over-voltage"),
            ("RS03", robstride.REPORTED + 14, "stall overload"),
        ):  # fmt: skip
            inject(monkeypatch, "latched", code)
            with content_of(own_folder / "robot.yaml") as content:
                content["motors"]["knee"]["protocol"] = protocol
            options = ("--robot", own_folder, "--joint", JOINT, "--yes")
            outcome = shell("can", "clear", "--bus", "virtual", *options)
            assert (outcome.status, outcome.err) == (0, ""), outcome
            first, *_, last = outcome.out.splitlines()
            assert (message in first, first.split()[0], last.split()[0]) == (True, JOINT, JOINT), outcome.out


def test_refusals_name_their_cause(shell: Shell) -> None:
    for verb in ("enable", "zero", "clear"):
        assert "--yes" in shell.refuses("can", verb, "--bus", "virtual")
        for wrong in (("--joint", "tail"), ("--robot", "rex")):  # named before the question
            assert f"'{wrong[1]}'" in shell.refuses("can", verb, "--bus", "virtual", *wrong)
    rows = (("nonsense", "'nonsense'"), ("serial", "'can0'"), ("virtual --robot rex", "'rex'"))
    for bus, named in rows:
        for verb in ("scan", "monitor", "enable --yes", "zero --yes", "clear --yes"):
            assert named in shell.refuses("can", *verb.split(), "--bus", *bus.split())
    complaint = shell.refuses("can", "monitor", "--bus", "virtual", "--joint", "tail")
    assert "'tail'" in complaint
    assert "FR_hip_joint" in complaint


def test_an_unknown_motor_fails_a_scan(shell: Shell, go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    known = set(scan.expected(wiring_of(go1)))
    for found, status in ((known, 0), (known | {scan.FoundMotor(2, 99, "MIT mode")}, 1)):
        monkeypatch.setattr(scan, "scan", lambda *_, found=found: found)
        outcome = shell("can", "scan", "--bus", "virtual")
        assert (outcome.status, "not in robot.yaml" in outcome.out) == (status, status == 1)

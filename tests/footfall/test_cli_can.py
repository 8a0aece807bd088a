"""`footfall can` on a simulated robot: output, questions, refusals."""

import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from edited import content_of
from shell import Shell

from footfall.deploy import bench, scan
from footfall.deploy.drivers import odrive, robstride
from footfall.deploy.wiring import wiring_of
from footfall.plant import serve
from footfall.plant.motors import MotorFaults
from footfall.plant.robot import SimulatedRobot
from footfall.robots.description import Robot


def joints(out: str) -> list[list[str]]:
    """The rows of a table without its header."""
    return [line.split() for line in out.splitlines()[1:]]


def rows_of(shell: Shell, *tokens: str | Path) -> list[list[str]]:
    """The rows of a successful call."""
    outcome = shell("can", *tokens)
    assert (outcome.status, outcome.err) == (0, ""), outcome
    return joints(outcome.out)


class Turns:
    """Robot and host take turns: the robot's time advances only while the host waits for its next tick."""

    def __init__(self) -> None:
        self._asked, self._passed = threading.Semaphore(0), threading.Semaphore(0)
        self._left_us = 0  # of the requested frames

    def ask(self, us: int) -> None:
        """Wait until the robot's time has advanced by this much."""
        self._left_us = us
        self._asked.release()
        assert self._passed.acquire(timeout=60.0), "the simulated robot does not run"

    def live(self, us: int) -> None:
        """Whether the robot's time has advanced by this much.

        It waits for a request, and is slow without one.
        """
        if self._left_us > 0:
            self._left_us -= us
            if self._left_us > 0:
                return
            self._passed.release()
        self._asked.acquire(timeout=0.02)


class TurnsClock:
    """The clock of the robot or of the host."""

    realtime = True

    def __init__(self, turn: Callable[[int], None], period_us: int) -> None:
        self._turn, self._period_us, self._now_us = turn, period_us, 0

    def next_tick(self) -> int:
        self._turn(self._period_us)
        self._now_us += self._period_us
        return self._now_us

    def lateness_us(self) -> float:
        return 0.0


Faulty = Callable[[Callable[[MotorFaults], np.ndarray], int], None]
VICTIM = 11  # RL_calf_joint


def with_knees(folder: Path, protocol: str) -> Path:
    """A robot with motors of another kind in its knees."""
    with content_of(folder / "robot.yaml") as content:
        content["motors"]["knee"]["protocol"] = protocol
    return folder


@pytest.fixture
def faulty(monkeypatch: pytest.MonkeyPatch) -> Faulty:
    """Gives a motor of the simulated robot an error from the start."""

    def inject(which: Callable[[MotorFaults], np.ndarray], code: int) -> None:
        def robot(*arguments: Any) -> SimulatedRobot:
            body = SimulatedRobot(*arguments)
            which(body.faults.motors)[VICTIM] = code
            return body

        monkeypatch.setattr(serve, "SimulatedRobot", robot)

    return inject


class TestVirtual:
    """A bus within this process, with a simulated robot on it."""

    @pytest.fixture(autouse=True)
    def turns(self, monkeypatch: pytest.MonkeyPatch) -> None:
        turns = Turns()
        monkeypatch.setattr(bench, "WallClock", partial(TurnsClock, turns.ask))
        monkeypatch.setattr(scan, "WallClock", partial(TurnsClock, turns.ask))
        monkeypatch.setattr(serve, "WallClock", partial(TurnsClock, turns.live))
        # With wall-clock time stamps, frames would be too old whenever a busy machine delays a thread.
        monkeypatch.setattr(serve, "not_before", lambda frames, time_us: frames)

    def test_a_scan_finds_the_motors_of_robot_yaml(self, shell: Shell) -> None:
        rows = rows_of(shell, "scan", "--bus", "virtual")
        assert rows[0] == ["can0", "1", "MIT", "mode", "FR_hip_joint", "found"]
        assert len(rows) == 12

    def test_one_motor_or_all_are_watched(self, shell: Shell) -> None:
        watched = ("monitor", "--bus", "virtual", "--duration", "0.2")
        assert len(rows_of(shell, *watched)) == 12
        (row,) = rows_of(shell, *watched, "--joint", "RL_calf_joint")
        assert row[:4] == ["RL_calf_joint", "can3", "3", "AK10-9"]
        assert float(row[4]) < -1.5

    def test_motors_are_enabled_for_a_moment(self, shell: Shell) -> None:
        assert len(rows_of(shell, "enable", "--bus", "virtual", "--duration", "0.2", "--yes")) == 12

    @pytest.mark.parametrize(
        ("verb", "fault", "code"),
        [
            (["monitor"], lambda motors: motors.silent, 1),
            (["monitor"], lambda motors: motors.error, 2),
            (["enable", "--yes"], lambda motors: motors.error, 2),
        ],
    )
    def test_a_silent_motor_or_a_motor_with_an_error_is_named_with_status_1(
        self, shell: Shell, faulty: Faulty, verb: list[str], fault: Any, code: int
    ) -> None:
        faulty(fault, code)
        outcome = shell("can", *verb, "--bus", "virtual", "--duration", "0.2")
        assert outcome.status == 1
        assert "RL_calf_joint" in outcome.out.splitlines()[-1]

    def test_a_zero_is_set(self, shell: Shell) -> None:
        (row,) = rows_of(shell, "zero", "--bus", "virtual", "--joint", "RL_calf_joint", "--yes")
        assert abs(float(row[4])) < 0.05

    @pytest.mark.parametrize(
        ("protocol", "code", "message"),
        [
            ("ODrive", odrive.WATCHDOG, "timeout"),
            ("DM8009", 8, "over-voltage"),
            ("RS03", robstride.REPORTED + 14, "stall overload"),
        ],
    )
    def test_a_latched_error_is_cleared(
        self, shell: Shell, own_folder: Path, faulty: Faulty, protocol: str, code: int, message: str
    ) -> None:
        faulty(lambda motors: motors.latched, code)
        knees = with_knees(own_folder, protocol)
        options = ("--robot", knees, "--joint", "RL_calf_joint", "--yes")
        outcome = shell("can", "clear", "--bus", "virtual", *options)
        assert (outcome.status, outcome.err) == (0, ""), outcome
        first, *table = outcome.out.splitlines()
        assert first.startswith("RL_calf_joint")
        assert message in first
        assert table[-1].split()[0] == "RL_calf_joint"


def test_refusals_name_their_cause(shell: Shell) -> None:
    for verb in ("enable", "zero", "clear"):
        assert "--yes" in shell.refuses("can", verb, "--bus", "virtual")
    for options, named in (
        ("--bus nonsense", "'nonsense'"),
        ("--bus serial", "'can0'"),
        ("--bus virtual --robot rex", "'rex'"),
    ):
        for verb in ("scan", "monitor", "enable --yes", "zero --yes", "clear --yes"):
            assert named in shell.refuses("can", *verb.split(), *options.split())
    complaint = shell.refuses("can", "monitor", "--bus", "virtual", "--joint", "tail")
    assert "'tail'" in complaint
    assert "FR_hip_joint" in complaint


@pytest.mark.parametrize(("extra", "status"), [(set(), 0), ({scan.FoundMotor(2, 99, "MIT mode")}, 1)])
def test_a_motor_that_robot_yaml_does_not_know_makes_a_scan_fail(
    shell: Shell, go1: Robot, monkeypatch: pytest.MonkeyPatch, extra: set[scan.FoundMotor], status: int
) -> None:
    known = set(scan.expected(wiring_of(go1)))
    monkeypatch.setattr(scan, "scan", lambda *_: known | extra)
    outcome = shell("can", "scan", "--bus", "virtual")
    assert outcome.status == status
    assert ("not in robot.yaml" in outcome.out) is bool(extra)

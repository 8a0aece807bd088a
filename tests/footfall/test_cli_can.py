"""`footfall can` on a simulated robot: output, questions, refusals."""

import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from multicast import robot_on_multicast
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


def tried(shell: Shell, *tokens: str | Path) -> list[list[str]]:
    """The rows of the first successful try: a busy machine loses datagrams."""
    for _ in range(6):
        outcome = shell("can", *tokens)
        if (outcome.status, outcome.err) == (0, ""):
            return joints(outcome.out)
    raise AssertionError(outcome)


class Turns:
    """The robot's time advances only while the user's end waits for its tick, at any speed of both."""

    def __init__(self) -> None:
        self._asked, self._passed = threading.Semaphore(0), threading.Semaphore(0)
        self._left_us = 0  # of the requested ones

    def ask(self, us: int) -> None:
        """Wait until the robot's time has advanced by this much."""
        self._left_us = us
        self._asked.release()
        assert self._passed.acquire(timeout=60.0), "the simulated robot does not run"

    def live(self, us: int) -> None:
        """The robot's time has advanced by this; it waits for a request, and is slow without one."""
        if self._left_us > 0:
            self._left_us -= us
            if self._left_us > 0:
                return
            self._passed.release()
        self._asked.acquire(timeout=0.02)


class TurnsClock:
    """The clock of one of the two."""

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
    declaration = folder / "robot.yaml"
    content = yaml.safe_load(declaration.read_text())
    content["motors"]["knee"]["protocol"] = protocol
    declaration.write_text(yaml.safe_dump(content))
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
        # Stamps of the wall's time would make a frame old while a busy machine holds a thread up.
        monkeypatch.setattr(serve, "not_before", lambda frames, time_us: frames)

    def test_a_scan_finds_the_motors_of_robot_yaml(self, shell: Shell) -> None:
        rows = rows_of(shell, "scan", "--bus", "virtual")
        assert rows[0] == ["can0", "1", "MIT", "mode", "FR_hip_joint", "found"]
        assert len(rows) == 12

    def test_motors_are_watched_one_or_all(self, shell: Shell) -> None:
        watched = ("monitor", "--bus", "virtual", "--duration", "0.2")
        assert len(rows_of(shell, *watched)) == 12
        (row,) = rows_of(shell, *watched, "--joint", "RL_calf_joint")
        assert row[:4] == ["RL_calf_joint", "can3", "3", "AK10-9"]
        assert float(row[4]) < -1.5

    def test_motors_are_switched_on_for_a_moment(self, shell: Shell) -> None:
        assert len(rows_of(shell, "enable", "--bus", "virtual", "--duration", "0.2", "--yes")) == 12

    @pytest.mark.parametrize(
        ("verb", "fault", "code", "message"),
        [
            (["monitor"], lambda motors: motors.silent, 1, "no answer from RL_calf_joint (can3, id 3)"),
            (["monitor"], lambda motors: motors.error, 2, "RL_calf_joint reports over-current"),
            (["enable", "--yes"], lambda motors: motors.error, 2, "RL_calf_joint reports over-current"),
        ],
    )
    def test_a_silent_motor_or_one_with_an_error_is_named_with_status_1(
        self,
        shell: Shell,
        faulty: Faulty,
        verb: list[str],
        fault: Callable[[MotorFaults], np.ndarray],
        code: int,
        message: str,
    ) -> None:
        faulty(fault, code)
        outcome = shell("can", *verb, "--bus", "virtual", "--duration", "0.2")
        assert outcome.status == 1
        assert outcome.out.splitlines()[-1] == message

    def test_a_zero_is_set(self, shell: Shell) -> None:
        (row,) = rows_of(shell, "zero", "--bus", "virtual", "--joint", "RL_calf_joint", "--yes")
        assert abs(float(row[4])) < 0.05

    @pytest.mark.parametrize(
        ("protocol", "code", "message"),
        [
            ("ODrive", odrive.WATCHDOG, "a communication timeout, and is disabled"),
            ("DM8009", 8, "over-voltage"),
            ("RS03", 4, "over-temperature"),
            ("RS03", robstride.REPORTED + 14, "stall overload"),
        ],
    )
    def test_a_latched_error_is_cleared(
        self, shell: Shell, own_folder: Path, faulty: Faulty, protocol: str, code: int, message: str
    ) -> None:
        faulty(lambda motors: motors.latched, code)
        knees = with_knees(own_folder, protocol)
        outcome = shell(
            "can", "clear", "--bus", "virtual", "--robot", knees, "--joint", "RL_calf_joint", "--yes"
        )
        assert (outcome.status, outcome.err) == (0, ""), outcome
        first, *table = outcome.out.splitlines()
        assert first == f"RL_calf_joint reported {message}: cleared"
        assert table[-1].split()[0] == "RL_calf_joint"

    def test_a_persistent_error_is_named(self, shell: Shell, own_folder: Path, faulty: Faulty) -> None:
        faulty(lambda motors: motors.error, 8)
        knees = with_knees(own_folder, "DM8009")
        outcome = shell(
            "can", "clear", "--bus", "virtual", "--robot", knees, "--joint", "RL_calf_joint", "--yes"
        )
        assert outcome.status == 1
        assert outcome.out.splitlines()[-1] == "RL_calf_joint reports over-voltage"
        assert "cleared" not in outcome.out

    def test_motors_that_cannot_clear_errors_are_reported(self, shell: Shell) -> None:
        outcome = shell("can", "clear", "--bus", "virtual", "--yes")
        assert outcome.status == 1
        assert outcome.out.splitlines()[-1] == (
            "these motors have no frame that clears errors: switch their power off and on"
        )


class TestRefusals:
    @pytest.mark.parametrize("verb", ["enable", "zero", "clear"])
    def test_nothing_is_done_without_confirmation(self, shell: Shell, verb: str) -> None:
        assert shell.refuses("can", verb, "--bus", "virtual") == "no terminal for the confirmation: add --yes"

    @pytest.mark.parametrize("answer", ["", "n", "yep"])
    def test_other_answers_are_no(self, shell: Shell, monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
        monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
        monkeypatch.setattr("builtins.input", lambda _: answer)
        assert shell.refuses("can", "zero", "--bus", "virtual") == "not confirmed"

    def test_a_wrong_interface_or_robot_is_one_line(self, shell: Shell) -> None:
        for options, result in (
            ("--bus nonsense", "no bus 'nonsense'"),
            ("--bus serial", "cannot open bus 'can0' on serial"),
            ("--bus virtual --robot rex", "no robot 'rex'"),
        ):
            for verb in ("scan", "monitor", "enable --yes", "zero --yes", "clear --yes"):
                assert result in shell.refuses("can", *verb.split(), *options.split())

    def test_an_unknown_joint_is_named(self, shell: Shell) -> None:
        complaint = shell.refuses("can", "monitor", "--bus", "virtual", "--joint", "tail")
        assert complaint.startswith("no joint 'tail': there are FR_hip_joint,")

    @pytest.mark.parametrize("duration", ["0", "-1", "nan"])
    def test_an_invalid_duration_is_refused(self, shell: Shell, duration: str) -> None:
        assert "duration" in shell.refuses("can", "monitor", "--duration", duration).lower()


def test_another_processs_robot_is_scanned_watched(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every motor heard at least once counts: a busy machine may stall at the end."""
    monkeypatch.setattr(bench, "SILENCE_TIMEOUT_US", 60_000_000)
    with robot_on_multicast("--duration", "600", "--motor-timeout", "20"):
        assert [row[-1] for row in tried(shell, "scan", "--bus", "udp_multicast")] == ["found"] * 12
        assert len(tried(shell, "monitor", "--bus", "udp_multicast", "--duration", "1")) == 12


def test_a_scan_is_compared_to_yaml(shell: Shell, own_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The motor with id 3 on can1 has id 9 there: one is missing, one is too many."""
    monkeypatch.setattr(scan, "scan", lambda *_: {scan.Found(1, 3, "MIT mode")})
    declaration = own_folder / "robot.yaml"
    content = yaml.safe_load(declaration.read_text())
    content["joints"][5]["id"] = 9
    declaration.write_text(yaml.safe_dump(content))
    outcome = shell("can", "scan", "--bus", "virtual", "--robot", own_folder)
    assert outcome.status == 1
    rows = [row for row in joints(outcome.out) if row[0] == "can1" and row[1] in "39"]
    assert [row[1:2] + row[4:] for row in rows] == [
        ["3", "not", "in", "robot.yaml", "found"],
        ["9", "FL_calf_joint", "missing"],
    ]


@pytest.mark.parametrize(("extra", "status"), [(set(), 0), ({scan.Found(2, 99, "MIT mode")}, 1)])
def test_a_motor_that_robot_yaml_does_not_know_makes_a_scan_fail(
    shell: Shell, go1: Robot, monkeypatch: pytest.MonkeyPatch, extra: set[scan.Found], status: int
) -> None:
    known = set(scan.expected(wiring_of(go1)))
    monkeypatch.setattr(scan, "scan", lambda *_: known | extra)
    outcome = shell("can", "scan", "--bus", "virtual")
    assert outcome.status == status
    assert ("not in robot.yaml" in outcome.out) is bool(extra)

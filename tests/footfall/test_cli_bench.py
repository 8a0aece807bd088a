"""What each verb of `footfall can` does with the motors, in which order, and what it tells of it.

The motors and their buses are stood in for; nothing moves and no time passes.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
from shell import Shell

from footfall.deploy.bench import MotorState
from footfall.deploy.wiring import Wiring
from footfall.robots.description import Robot

HIP = MotorState("hip", "can0", 1, "AK10-9", 0.004, 0.5, 1.0, -0.25, 41.0, 48.04, "")
TABLE = (
    "joint  bus   id  motor   rad     rad/s  N m    deg C  V     age, ms",
    "hip    can0  1   AK10-9  +0.500  +1.00  -0.25  41     48.0  4",
)


class Motors:
    """Does nothing, notes what it shall do, and answers as it is told to."""

    def __init__(self) -> None:
        self.log: list[Any] = []
        self.answers: dict[str, str] = {}
        self.states_in_turn = [[HIP]]
        self.interrupts = False

    def __getattr__(self, name: str) -> Any:
        return lambda: self.log.append(name) or self.answers.get(name, "")

    def watch(self, seconds: float, show: Any) -> None:
        self.log.append(("watch", seconds))
        show()
        if self.interrupts:
            raise KeyboardInterrupt

    def idle(self, seconds: float, show: Any) -> None:
        self.log.append(("idle", seconds))
        show()

    def states(self) -> list[MotorState]:
        return self.states_in_turn.pop(0) if len(self.states_in_turn) > 1 else self.states_in_turn[0]


@pytest.fixture
def motors() -> Motors:
    return Motors()


@pytest.fixture
def place(motors: Motors, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Where the motors were looked for: what was opened, served and closed, in order."""
    log: list[Any] = []

    @contextmanager
    def serving(robot: Robot, interface: str) -> Iterator[None]:
        log.append(("served", robot.name, interface))
        yield
        log.append("served no more")

    def opened(kind: str, names: tuple[str, ...], filters: tuple) -> Any:
        log.append(("opened", kind, names, filters))
        return SimpleNamespace(close=lambda: log.append("closed"))

    @contextmanager
    def switched_off_afterwards(bench: Motors) -> Iterator[None]:
        assert bench is motors
        try:
            yield
        finally:
            log.append("off")

    def bench(wiring: Wiring, _: Any) -> Motors:
        log.append(("bench", wiring.joint_names))
        return motors

    monkeypatch.setattr("footfall.plant.serve.serving", serving)
    monkeypatch.setattr("footfall.deploy.interfaces.open_interfaces", opened)
    monkeypatch.setattr("footfall.deploy.bench.switched_off_afterwards", switched_off_afterwards)
    monkeypatch.setattr("footfall.deploy.bench.Bench", bench)
    return log


class TestPlace:
    BUSES = ("can0", "can1", "can2", "can3")

    def test_motors_are_off_and_buses_closed_whatever_ends_it(
        self, shell: Shell, motors: Motors, place: list[Any]
    ) -> None:
        motors.interrupts = True
        assert shell("can", "clear", "--yes").status == 130
        assert place[-2:] == ["off", "closed"]


@pytest.mark.usefixtures("place")
class TestActs:
    """Acts in order; where one reports a problem, what is not done any more, and what is told."""

    @pytest.mark.parametrize(
        ("verb", "problem", "acts", "table"),
        [
            ("monitor", "", ["query_settings", ("watch", math.inf), "missing"], True),
            ("monitor --duration 1.5", "", ["query_settings", ("watch", 1.5), "missing"], True),
            ("monitor", "query_settings", ["query_settings", ("watch", math.inf)], True),
            ("monitor", "missing", ["query_settings", ("watch", math.inf), "missing"], True),
            ("enable --yes", "", ["query_settings", "enable", ("idle", 3.0), "missing"], True),
            ("enable --yes --duration 1.5", "", ["query_settings", "enable", ("idle", 1.5), "missing"], True),
            ("enable --yes", "query_settings", ["query_settings"], False),
            ("enable --yes", "enable", ["query_settings", "enable"], False),
            ("enable --yes", "missing", ["query_settings", "enable", ("idle", 3.0), "missing"], True),
            ("zero --yes", "", ["query_settings", "settle", "zero", "missing"], True),
            ("zero --yes", "query_settings", ["query_settings"], True),
            ("zero --yes", "settle", ["query_settings", "settle"], True),
            ("zero --yes", "zero", ["query_settings", "settle", "zero"], True),
            ("zero --yes", "missing", ["query_settings", "settle", "zero", "missing"], True),
            ("clear --yes", "", [("watch", 0.5), "clear", "missing"], True),
            ("clear --yes", "clear", [("watch", 0.5), "clear"], True),
            ("clear --yes", "missing", [("watch", 0.5), "clear", "missing"], True),
        ],
    )
    def test_in_order_until_a_problem(
        self, shell: Shell, motors: Motors, verb: str, problem: str, acts: list[Any], table: bool
    ) -> None:
        motors.answers = {problem: f"{problem} failed"} if problem else {}
        outcome = shell("can", *verb.split())
        assert motors.log == acts
        told = [f"{problem} failed"] if problem else []
        assert outcome.out.splitlines() == [*(TABLE if table else ()), *told]
        assert (outcome.status, outcome.err) == (1 if problem else 0, "")

    def test_ctrl_c_ends_a_look_as_its_duration_does(self, shell: Shell, motors: Motors) -> None:
        motors.interrupts = True
        outcome = shell("can", "monitor")
        assert (outcome.status, outcome.out.splitlines()) == (0, list(TABLE))
        assert motors.log[-1] == "missing"

    @pytest.mark.parametrize("verb", ["monitor", "enable --yes", "zero --yes", "clear --yes"])
    def test_errors_of_motors_come_after_the_problem_and_are_status_1(
        self, shell: Shell, motors: Motors, verb: str
    ) -> None:
        motors.states_in_turn = [
            [HIP._replace(error="over-current"), HIP, HIP._replace(joint="knee", error="heat")]
        ]
        for problem in ([], ["nobody answers"]):
            motors.answers["missing"] = "".join(problem)
            outcome = shell("can", *verb.split())
            lines = outcome.out.splitlines()[4:]
            assert (outcome.status, lines) == (
                1, [*problem, "hip reports over-current", "knee reports heat"],
            )  # fmt: skip

    def test_of_errors_those_that_are_gone_are_told(self, shell: Shell, motors: Motors) -> None:
        knee, ankle = HIP._replace(joint="knee"), HIP._replace(joint="ankle")
        stuck = ankle._replace(error="heat")
        motors.states_in_turn = [[HIP._replace(error="over-current"), knee, stuck], [HIP, knee, stuck]]
        outcome = shell("can", "clear", "--yes")
        lines = outcome.out.splitlines()
        assert lines[0] == "hip reported over-current: cleared"
        assert lines[1].split()[0] == "joint"
        assert (outcome.status, lines[5:]) == (1, ["ankle reports heat"])

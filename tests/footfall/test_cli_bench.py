"""The output of each verb of `footfall can`, with fake motors and buses; nothing moves."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
from shell import Shell

from footfall.deploy.bench import MotorState

HIP = MotorState("hip", "can0", 1, "AK10-9", 0.004, 0.5, 1.0, -0.25, 41.0, 48.04, "")
TABLE = [
    "joint  bus   id  motor   rad     rad/s  N m    deg C  V     age, ms",
    "hip    can0  1   AK10-9  +0.500  +1.00  -0.25  41     48.0  4",
]
VERBS = ("monitor", "enable --yes", "zero --yes", "clear --yes")


class Motors:
    """Records its orders and their durations, and returns prepared answers."""

    def __init__(self) -> None:
        self.done: list[str] = []
        self.seconds: float | None = None
        self.answers: dict[str, str] = {}
        self.states_in_turn = [[HIP]]
        self.interrupts = False

    def __getattr__(self, name: str) -> Any:
        return lambda: self.done.append(name) or self.answers.get(name, "")

    def watch(self, seconds: float, show: Any) -> None:
        self.seconds = seconds
        show()
        if self.interrupts:
            raise KeyboardInterrupt

    def idle(self, seconds: float, show: Any) -> None:
        self.seconds = seconds
        show()

    def states(self) -> list[MotorState]:
        return self.states_in_turn.pop(0) if len(self.states_in_turn) > 1 else self.states_in_turn[0]


@pytest.fixture
def closed() -> list[str]:
    """What has been ended: motors, bus."""
    return []


@pytest.fixture(autouse=True)
def motors(closed: list[str], monkeypatch: pytest.MonkeyPatch) -> Motors:
    motors = Motors()

    @contextmanager
    def serving(*_: object) -> Iterator[None]:
        yield

    @contextmanager
    def switched_off_afterwards(bench: Motors) -> Iterator[None]:
        try:
            yield
        finally:
            closed.append("motors")

    bus = SimpleNamespace(close=lambda: closed.append("bus"))
    monkeypatch.setattr("footfall.plant.serve.serving", serving)
    monkeypatch.setattr("footfall.deploy.interfaces.open_interfaces", lambda *_: bus)
    monkeypatch.setattr("footfall.deploy.bench.switched_off_afterwards", switched_off_afterwards)
    monkeypatch.setattr("footfall.deploy.bench.Bench", lambda *_: motors)
    return motors


def test_motors_are_disabled_after_any_outcome(shell: Shell, motors: Motors, closed: list[str]) -> None:
    motors.interrupts = True
    assert shell("can", "clear", "--yes").status == 130
    assert closed == ["motors", "bus"]


@pytest.mark.parametrize(
    ("verb", "act", "later"),
    [
        ("monitor", "missing", ()),
        ("enable --yes", "query_settings", ("enable",)),
        ("enable --yes", "enable", ("missing",)),
        ("enable --yes", "missing", ()),
        ("zero --yes", "query_settings", ("settle", "zero")),
        ("zero --yes", "settle", ("zero",)),
        ("zero --yes", "zero", ()),
        ("zero --yes", "missing", ()),
        ("clear --yes", "clear", ()),
        ("clear --yes", "missing", ()),
    ],
)
def test_a_problem_is_reported_with_status_1_and_ends_the_command(
    shell: Shell, motors: Motors, verb: str, act: str, later: tuple[str, ...]
) -> None:
    motors.answers = {act: "it failed"}
    outcome = shell("can", *verb.split())
    assert (outcome.status, outcome.err, outcome.out.splitlines()[-1]) == (1, "", "it failed")
    assert act in motors.done
    assert not set(later) & set(motors.done)


def test_without_a_problem_the_motors_are_shown(shell: Shell, motors: Motors) -> None:
    for verb, act in zip(VERBS, ("missing", "enable", "zero", "clear"), strict=True):
        motors.done.clear()
        outcome = shell("can", *verb.split())
        assert (outcome.status, outcome.err, outcome.out.splitlines()) == (0, "", TABLE)
        assert act in motors.done
    for verb in VERBS[:2]:
        shell("can", *verb.split(), "--duration", "1.5")
        assert motors.seconds == 1.5

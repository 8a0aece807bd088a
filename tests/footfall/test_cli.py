"""The command line: options, their limits, questions, and the exit status for each result of a verb."""

import io
import signal
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock, call, patch

import pytest
from recorder import Recorder
from shell import Shell

from footfall import UserError, cli
from footfall.confirm import confirm
from footfall.machine import Finding


def test_a_result_sets_status_and_last_line(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    for result, status, line in (
        (None, 0, ""), (3, 3, ""), ("text", 0, ""), (UserError("a\n  b"), 2, "footfall: a b\n"),
        (OSError(28, "No space left"), 2, "No space left"), (BrokenPipeError(32, "Broken pipe"), 141, ""),
        (KeyboardInterrupt(), 130, "footfall: interrupted\n"), (SystemExit(1), 141, ""),
    ):  # fmt: skip
        monkeypatch.setattr(cli, "app", Mock(side_effect=[result]))  # returns it, or raises it
        outcome = shell("train")
        assert outcome.status == status, result
        assert line in outcome.err
        assert outcome.err.count("\n") == (1 if line else 0)
    monkeypatch.setattr(cli, "app", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):  # an unexpected exception keeps its traceback
        shell("train")


def test_output_that_reaches_no_reader_is_noticed_before_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Printed text may stay in a buffer until the process ends; its failure would appear too late."""
    monkeypatch.setattr(cli, "app", lambda *_, **__: 0)
    for error, status in ((BrokenPipeError(), 141), (OSError(28, "No space left on device"), 2)):
        monkeypatch.setattr(sys, "stdout", io.StringIO())
        monkeypatch.setattr(sys.stdout, "flush", Mock(side_effect=error))
        assert cli.main(["doctor"]) == status


def test_sigterm_lets_a_verb_close_its_resources(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """`timeout` sends SIGTERM twice; the second one arrives while the verb closes what it opened."""
    closed: list[str] = []

    def verb(*_: object, **__: object) -> None:
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(signal.SIGTERM)
            closed.append("pool")

    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(cli, "app", verb)
    outcome = shell("train")
    assert (outcome.status, outcome.err) == (143, "footfall: terminated\n")
    assert closed == ["pool"]
    assert signal.getsignal(signal.SIGTERM) is before


def test_every_verb_is_listed_and_explains_itself(shell: Shell) -> None:
    listed = shell("--help").out
    verbs = "train sweep watch evaluate export deploy compare replay log demo diagnose doctor"
    for verb in verbs.split():
        assert f" {verb} " in listed
        explained = shell(verb, "--help")
        assert (explained.status, f"footfall {verb}" in explained.out) == (0, True), verb
        assert explained.out.count("A run folder,") <= 1  # of POLICY; options that take a policy say what for
    assert shell("--version").out.strip().count(".") == 2


def test_diagnose_names_the_first_non_finite_value(shell: Shell, called: Recorder) -> None:
    found = SimpleNamespace(
        failure=SimpleNamespace(iteration=12, reason="nan then"), differences=["another JAX"],
        finding="the reward", saved=Path("s.npz"),
    )  # fmt: skip
    called.replace("footfall.train.api.diagnose", lambda _, report: report("11 is sound") or found)
    for found.reason, status in (("nan again", 0), (None, 1)):
        outcome = shell("diagnose", "run")
        assert outcome.status == status
        for fact in ("11 is sound", "another JAX", "nan then", found.reason or "no", "the reward", "s.npz"):
            assert fact in outcome.out


def test_a_recovered_log_is_beside_its_file(shell: Shell, called: Recorder, tmp_path: Path) -> None:
    called.replace("footfall.deploy.recover.recover", SimpleNamespace(messages=42, damaged=3))
    assert "absent" in shell.refuses("log", "recover", "a.mcap", "--out", "absent/b.mcap")
    assert called.names == []
    (tmp_path / "logs").mkdir()
    outcome = shell("log", "recover", "logs/walk.mcap")
    assert called.of("recover") == ((Path("logs/walk.mcap"), Path("logs/walk.recovered.mcap")), {})
    assert {"42", "3"} <= set(outcome.out.split())


def test_doctor_shows_problems_and_remedies(shell: Shell, called: Recorder) -> None:
    problem = Finding("packages", False, "no jax", "pip install jax")
    called.replace("footfall.machine.findings", [Finding("processors", True, "2 cores"), problem])
    first, second, *advice = shell("doctor").out.splitlines()
    for line, text in ((first, "2 cores"), (second, "no jax"), (advice[-1], "pip install jax")):
        assert text in line


def test_only_a_typed_yes_or_the_option_confirms() -> None:
    def asked(answer: str | None, terminal: bool, yes: bool = False) -> list[Any]:
        """The questions asked for a confirmation; None ends the input."""
        answered = Mock(side_effect=EOFError if answer is None else [answer])
        with patch("sys.stdin.isatty", lambda: terminal), patch("builtins.input", answered):
            confirm("shall it move?", yes=yes)
        return answered.call_args_list

    for answer in ("y", "yes", "Y", "YES", " yes "):
        assert asked(answer, terminal=True) == [call("shall it move? [y/N] ")]
    for terminal in (True, False):
        assert asked("n", terminal, yes=True) == []
    for no in ("", "n", "yep", None):
        with pytest.raises(UserError):
            asked(no, terminal=True)
    with pytest.raises(UserError, match="--yes"):
        asked("y", terminal=False)

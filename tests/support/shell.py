"""Runs the command line inside the test's own process."""

from pathlib import Path
from typing import NamedTuple

import pytest

from footfall.cli import main


class CommandResult(NamedTuple):
    """What a user sees of a command."""

    status: int
    out: str
    err: str


class Shell:
    """Types commands into footfall."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *tokens: str | Path) -> CommandResult:
        self._capsys.readouterr()
        status = main([str(token) for token in tokens])
        return CommandResult(status, *self._capsys.readouterr())

    def refuses(self, *tokens: str | Path) -> str:
        """The error line of a command that must be refused with status 2 and no other output."""
        outcome = self(*tokens)
        assert outcome.status == 2, outcome
        assert outcome.err.startswith("footfall: ")
        assert outcome.err.count("\n") == 1, outcome.err
        assert outcome.out == ""
        return outcome.err.removeprefix("footfall: ").rstrip()

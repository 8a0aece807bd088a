"""The question that somebody has to answer before anything moves."""

import pytest

from footfall.common.errors import UserError
from footfall.confirm import confirm


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Questions that were asked; nobody is at the terminal."""
    questions: list[str] = []
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    monkeypatch.setattr("builtins.input", lambda question: questions.append(question) or "n")
    return questions


@pytest.mark.parametrize("answer", ["y", "yes", "Y", "YES", " yes "])
def test_yes_in_any_case_is_a_yes(asked: list[str], monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda question: asked.append(question) or answer)
    confirm("shall it move?", yes=False)
    assert asked == ["shall it move? [y/N] "]


def test_who_has_said_yes_beforehand_is_not_asked(asked: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    for terminal in (False, True):
        monkeypatch.setattr("sys.stdin.isatty", lambda terminal=terminal: terminal, raising=False)
        confirm("shall it move?", yes=True)
    assert asked == []


def test_nobody_is_not_asked(asked: list[str]) -> None:
    with pytest.raises(UserError, match="no terminal for the confirmation: add --yes"):
        confirm("shall it move?", yes=False)
    assert asked == []

"""Questions to the user."""

import pytest

from footfall.common.errors import UserError
from footfall.confirm import confirm


@pytest.fixture
def questions(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Questions that were asked; there is no terminal."""
    questions: list[str] = []
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    monkeypatch.setattr("builtins.input", lambda question: questions.append(question) or "n")
    return questions


@pytest.mark.parametrize("answer", ["y", "yes", "Y", "YES", " yes "])
def test_yes_in_any_case_is_a_yes(questions: list[str], monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda question: questions.append(question) or answer)
    confirm("shall it move?", yes=False)
    assert questions == ["shall it move? [y/N] "]


def test_with_yes_no_question_is_asked(questions: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    for terminal in (False, True):
        monkeypatch.setattr("sys.stdin.isatty", lambda terminal=terminal: terminal, raising=False)
        confirm("shall it move?", yes=True)
    assert questions == []


@pytest.mark.parametrize("answer", ["", "n", "yep"])
def test_any_other_answer_is_a_no(questions: list[str], monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda _: answer)
    with pytest.raises(UserError):
        confirm("shall it move?", yes=False)


def test_without_a_terminal_a_question_is_refused(questions: list[str]) -> None:
    with pytest.raises(UserError, match="--yes"):
        confirm("shall it move?", yes=False)
    assert questions == []


def test_the_end_of_the_input_means_no(questions: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def end_of_input(_: str) -> str:
        raise EOFError

    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", end_of_input)
    with pytest.raises(UserError):
        confirm("shall it move?", yes=False)

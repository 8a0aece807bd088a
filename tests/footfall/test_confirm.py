"""Questions to the user."""

import pytest

from footfall.common.errors import UserError
from footfall.confirm import confirm


def asked(monkeypatch: pytest.MonkeyPatch, answer: str | None, terminal: bool, yes: bool) -> list[str]:
    """The questions asked for a confirmation; None ends the input."""
    questions: list[str] = []

    def answered(question: str) -> str:
        questions.append(question)
        if answer is None:
            raise EOFError
        return answer

    monkeypatch.setattr("sys.stdin.isatty", lambda: terminal, raising=False)
    monkeypatch.setattr("builtins.input", answered)
    confirm("shall it move?", yes=yes)
    return questions


@pytest.mark.parametrize("answer", ["y", "yes", "Y", "YES", " yes "])
def test_yes_in_any_case_is_a_yes(monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    assert asked(monkeypatch, answer, terminal=True, yes=False) == ["shall it move? [y/N] "]


@pytest.mark.parametrize("terminal", [True, False])
def test_with_yes_no_question_is_asked(monkeypatch: pytest.MonkeyPatch, terminal: bool) -> None:
    assert asked(monkeypatch, "n", terminal, yes=True) == []


@pytest.mark.parametrize("answer", ["", "n", "yep", None])
def test_any_other_answer_and_the_end_of_the_input_are_a_no(
    monkeypatch: pytest.MonkeyPatch, answer: str | None
) -> None:
    with pytest.raises(UserError):
        asked(monkeypatch, answer, terminal=True, yes=False)


def test_without_a_terminal_a_question_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UserError, match="--yes"):
        asked(monkeypatch, "y", terminal=False, yes=False)

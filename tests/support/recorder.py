"""Replaces the functions that a verb calls, and records their arguments."""

from typing import Any

import pytest


class Recorder:
    """Stands in for functions; each call and its arguments are kept in order."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._patch = monkeypatch
        self.calls: list[tuple[str, tuple, dict]] = []

    def replace(self, path: str, answer: Any = None) -> None:
        name = path.rpartition(".")[2]

        def call(*arguments: Any, **named: Any) -> Any:
            self.calls.append((name, arguments, named))
            return answer(*arguments, **named) if callable(answer) else answer

        self._patch.setattr(path, call)

    @property
    def names(self) -> list[str]:
        return [name for name, _, _ in self.calls]

    def of(self, name: str) -> tuple[tuple, dict]:
        """Arguments of the one call of this name."""
        ((arguments, named),) = [(a, k) for called, a, k in self.calls if called == name]
        return arguments, named

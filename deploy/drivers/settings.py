"""What motors tell of their settings: what is known, whom to ask for what next, and a time-out to be set."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

ASK_AGAIN = 10  # ticks without an answer: a late one is not lost, and what is asked twice is told twice
NONE = "no communication time-out"


class Question(NamedTuple):
    """What to ask of a motor, and what to write before that."""

    motor: int  # joint index
    setting: int
    write: int | None  # None to leave the setting as it is


class Settings:
    """The settings of n motors, by the maker's numbers.

    A motor's own time-out is set where it is off or too long, and asked for again: what a motor tells counts.
    """

    def __init__(self, settings: Sequence[int], time_out: int, longest_s: np.ndarray, step_s: float) -> None:
        """Nothing is known yet.

        Args:
            settings: which to ask for, in this order.
            time_out: which of them is the time after which a motor that hears nothing switches itself off;
                0 is never.
            longest_s: (n,) what that may be at most.
            step_s: what the time-out is counted in.
        """
        self.told: list[dict[int, float]] = [{} for _ in longest_s]
        self._settings, self._time_out, self._step_s = settings, time_out, step_s
        self._longest = np.rint(longest_s / step_s).astype(int).tolist()
        self._waits = [0] * len(longest_s)  # ticks until a motor is asked again

    def questions(self) -> list[Question]:
        """What to ask in this tick; of each motor one question at most, and none before it is due."""
        due = []
        for motor in range(len(self.told)):
            setting = self._missing(motor)
            write = None
            if setting is None and self.time_out_problem(motor):
                setting, write = self._time_out, self._longest[motor]
            if setting is None:
                continue
            if self._waits[motor]:
                self._waits[motor] -= 1
                continue
            self._waits[motor] = ASK_AGAIN
            due.append(Question(motor, setting, write))
        return due

    def hear(self, motor: int, setting: int, value: float) -> None:
        """A motor tells a setting. The next question need not wait if that was not known."""
        if setting not in self.told[motor]:
            self._waits[motor] = 0
        self.told[motor][setting] = value

    def _missing(self, motor: int) -> int | None:
        """The first setting that a motor has not told, None if it has told all."""
        return next((setting for setting in self._settings if setting not in self.told[motor]), None)

    def time_out_problem(self, motor: int) -> str:
        """What is wrong with the time-out that a motor has told; empty if nothing."""
        count, longest = self.told[motor][self._time_out], self._longest[motor]
        if 0 < count <= longest:
            return ""
        found = f"a communication time-out of {count * self._step_s:g} s" if count else NONE
        return f"has {found}, and does not take one of {longest * self._step_s:g} s"

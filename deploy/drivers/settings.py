"""Settings that motors report: which are known, which to read next, and which to write."""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from footfall.deploy.wiring import Wiring

ASK_AGAIN = 10  # ticks until an unanswered question is repeated
NONE = "no communication time-out"

Known = Mapping[int, float]  # settings of one motor by the maker's numbers


class Question(NamedTuple):
    """A setting to read, and a value to write before."""

    motor: int  # joint index
    setting: int
    write: float | None  # None to leave the setting as it is


class TimeOut(NamedTuple):
    """The setting after whose time a motor without commands disables itself."""

    setting: int  # its number; a value of 0 is never
    step_s: float  # its unit


class Limit(NamedTuple):
    """The setting that bounds what a drive does, whatever it is commanded."""

    setting: int  # its number
    name: str  # with its unit, for messages
    highest: np.ndarray  # (n,) to be set, in that unit; NaN to leave the setting unread


class Settings:
    """The settings of n motors.

    A motor's time-out is written where it is off or too long, its limit where it is another one. Both are
    read back: only the reply counts.
    """

    def __init__(
        self,
        wiring: Wiring,
        names: Mapping[int, str],
        time_out: TimeOut | None,
        check: Callable[[Known], str] = lambda _: "",
        limit: Limit | None = None,
    ) -> None:
        """Nothing is known at first.

        Args:
            wiring: names of the motors and their longest time-outs.
            names: settings to read, in this order, with their names for messages.
            time_out: which of them is the time-out; None for none.
            check: a problem with the settings of a motor that are all known; empty for none.
            limit: of the drive, beside `names`; None for none.
        """
        self.known: list[dict[int, float]] = [{} for _ in wiring.joint_names]
        self._wiring, self._time_out, self._check, self._limit = wiring, time_out, check, limit
        self._names = [dict(names) for _ in self.known]  # of each motor
        if time_out is not None:
            self._longest = np.rint(wiring.timeout_s / time_out.step_s).astype(int).tolist()
        if limit is not None:
            for motor in np.flatnonzero(~np.isnan(limit.highest)).tolist():
                self._names[motor][limit.setting] = limit.name
        self._waits = [0] * len(self.known)  # ticks until a question is repeated
        self._good = False

    def questions(self) -> list[Question]:
        """Questions of this tick: one for each motor at most, and none before it is due."""
        due = []
        for motor, known in enumerate(self.known):
            setting = next((number for number in self._names[motor] if number not in known), None)
            write = None
            if setting is None and self._time_out is not None and self._time_out_problem(motor):
                setting, write = self._time_out.setting, self._longest[motor]
            elif setting is None and self._limit is not None and self._limit_problem(motor):
                setting, write = self._limit.setting, float(self._limit.highest[motor])
            if setting is None:
                continue
            if self._waits[motor]:
                self._waits[motor] -= 1
                continue
            self._waits[motor] = ASK_AGAIN
            due.append(Question(motor, setting, write))
        return due

    def note(self, motor: int, setting: int, value: float) -> None:
        """Note a reported setting. The next question is due at once if it was unknown."""
        if setting not in self.known[motor]:
            self._waits[motor] = 0
        self.known[motor][setting] = value

    def problem(self) -> str:
        """First motor with a missing or wrong setting, and which; empty if all settings were right once."""
        if self._good:
            return ""
        for motor, known in enumerate(self.known):
            names = self._names[motor].items()
            missing = next((name for number, name in names if number not in known), "")
            problem = f"has not told its {missing}" if missing else self._check(known)
            if problem := problem or self._time_out_problem(motor) or self._limit_problem(motor):
                return f"motor {self._wiring.place(motor)} {problem}"
        self._good = True
        return ""

    def _time_out_problem(self, motor: int) -> str:
        """Problem with a motor's reported time-out; empty for none."""
        if self._time_out is None:
            return ""
        step_s = self._time_out.step_s
        count, longest = self.known[motor][self._time_out.setting], self._longest[motor]
        if 0 < count <= longest:
            return ""
        found = f"a communication time-out of {count * step_s:g} s" if count else NONE
        return f"has {found}, and does not take one of {longest * step_s:g} s"

    def _limit_problem(self, motor: int) -> str:
        """Problem with a motor's reported limit; empty for none."""
        limit = self._limit
        if limit is None or limit.setting not in self._names[motor]:
            return ""
        found, highest = self.known[motor][limit.setting], float(limit.highest[motor])
        if math.isclose(found, highest, rel_tol=1e-6):
            return ""
        return f"has {found:g} for its {limit.name}, and does not take {highest:g}"

"""Settings that motors report: which are known, which to read next, and a communication time-out to write."""

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
    write: int | None  # None to leave the setting as it is


class TimeOut(NamedTuple):
    """The setting after whose time a motor without commands disables itself."""

    setting: int  # its number; a value of 0 is never
    step_s: float  # its unit


class Settings:
    """The settings of n motors.

    A motor's time-out is written where it is off or too long, and read back: only the reply counts.
    """

    def __init__(
        self,
        wiring: Wiring,
        names: Mapping[int, str],
        time_out: TimeOut,
        check: Callable[[Known], str] = lambda _: "",
    ) -> None:
        """Nothing is known at first.

        Args:
            wiring: names of the motors and their longest time-outs.
            names: settings to read, in this order, with their names for messages.
            time_out: which of them is the time-out.
            check: a problem with the settings of a motor that are all known; empty for none.
        """
        self.known: list[dict[int, float]] = [{} for _ in wiring.joint_names]
        self._wiring, self._names, self._time_out, self._check = wiring, names, time_out, check
        self._longest = np.rint(wiring.timeout_s / time_out.step_s).astype(int).tolist()
        self._waits = [0] * len(self.known)  # ticks until a question is repeated
        self._good = False

    def questions(self) -> list[Question]:
        """Questions of this tick: one for each motor at most, and none before it is due."""
        due = []
        for motor, known in enumerate(self.known):
            setting = next((number for number in self._names if number not in known), None)
            write = None
            if setting is None and self._time_out_problem(motor):
                setting, write = self._time_out.setting, self._longest[motor]
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
            missing = next((name for number, name in self._names.items() if number not in known), "")
            problem = f"has not told its {missing}" if missing else self._check(known)
            if problem := problem or self._time_out_problem(motor):
                return f"motor {self._wiring.place(motor)} {problem}"
        self._good = True
        return ""

    def _time_out_problem(self, motor: int) -> str:
        """Problem with a motor's reported time-out; empty for none."""
        step_s = self._time_out.step_s
        count, longest = self.known[motor][self._time_out.setting], self._longest[motor]
        if 0 < count <= longest:
            return ""
        found = f"a communication time-out of {count * step_s:g} s" if count else NONE
        return f"has {found}, and does not take one of {longest * step_s:g} s"

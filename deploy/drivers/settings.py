"""Settings reported by motors: known ones, the next to read, and those to write."""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from footfall.deploy.wiring import Wiring

REPEAT_TICKS = 10  # ticks until a read without a reply is repeated
NO_TIMEOUT = "no communication timeout"

Known = Mapping[int, float]  # settings of one motor by the maker's numbers


class SettingRead(NamedTuple):
    """A setting to read, and a value to write before."""

    motor: int  # joint index
    setting: int
    write: float | None  # None: do not write the setting


class Timeout(NamedTuple):
    """The setting with the time after which a motor without commands disables itself."""

    setting: int  # number of the setting; a value of 0 means never
    step_s: float  # unit of the value


class Limit(NamedTuple):
    """The setting that limits a drive, independent of its commands."""

    setting: int  # number of the setting
    name: str  # name with unit, for messages
    highest: np.ndarray  # (n,) limit to set, in this unit; NaN: the setting is not read


class Settings:
    """Settings of n motors.

    A motor's timeout is written if it is off or too long, its limit if it differs. Both are read back: only
    the reply is a confirmation.
    """

    def __init__(
        self,
        wiring: Wiring,
        names: Mapping[int, str],
        timeout: Timeout | None,
        check: Callable[[Known], str] = lambda _: "",
        limit: Limit | None = None,
    ) -> None:
        """Initially no setting is known.

        Args:
            wiring: names of the motors and their longest timeouts.
            names: settings to read, in this order, with their names for messages.
            timeout: the setting that is the timeout; None for none.
            check: returns a problem of a motor with all settings known; empty for none.
            limit: limit of the drive, in addition to `names`; None for none.
        """
        self.known: list[dict[int, float]] = [{} for _ in wiring.joint_names]
        self._wiring, self._timeout, self._check, self._limit = wiring, timeout, check, limit
        self._names = [dict(names) for _ in self.known]  # for each motor
        if timeout is not None:
            self._max_counts = np.rint(wiring.timeout_s / timeout.step_s).astype(int).tolist()
        if limit is not None:
            for motor in np.flatnonzero(~np.isnan(limit.highest)).tolist():
                self._names[motor][limit.setting] = limit.name
        self._waits = [0] * len(self.known)  # ticks until a read is repeated
        self._complete = False

    def due_reads(self) -> list[SettingRead]:
        """Settings to read in this tick, at most one of each motor."""
        due = []
        for motor, known in enumerate(self.known):
            setting = next((number for number in self._names[motor] if number not in known), None)
            write = None
            if setting is None and self._timeout is not None and self._timeout_problem(motor):
                setting, write = self._timeout.setting, self._max_counts[motor]
            elif setting is None and self._limit is not None and self._limit_problem(motor):
                setting, write = self._limit.setting, float(self._limit.highest[motor])
            if setting is None:
                continue
            if self._waits[motor]:
                self._waits[motor] -= 1
                continue
            self._waits[motor] = REPEAT_TICKS
            due.append(SettingRead(motor, setting, write))
        return due

    def note(self, motor: int, setting: int, value: float) -> None:
        """Store a reported setting. If it was unknown, the next read is due at once."""
        if setting not in self.known[motor]:
            self._waits[motor] = 0
        self.known[motor][setting] = value

    def problem(self) -> str:
        """First motor with a missing or wrong setting, and the setting; empty once all were right."""
        if self._complete:
            return ""
        for motor, known in enumerate(self.known):
            names = self._names[motor].items()
            missing = next((name for number, name in names if number not in known), "")
            problem = f"has not reported its {missing}" if missing else self._check(known)
            if problem := problem or self._timeout_problem(motor) or self._limit_problem(motor):
                return f"motor {self._wiring.label(motor)} {problem}"
        self._complete = True
        return ""

    def _timeout_problem(self, motor: int) -> str:
        """Problem of a motor's reported timeout; empty for none."""
        if self._timeout is None:
            return ""
        step_s = self._timeout.step_s
        count, max_count = self.known[motor][self._timeout.setting], self._max_counts[motor]
        if 0 < count <= max_count:
            return ""
        found = f"a communication timeout of {count * step_s:g} s" if count else NO_TIMEOUT
        return f"has {found}, and does not accept {max_count * step_s:g} s"

    def _limit_problem(self, motor: int) -> str:
        """Problem of a motor's reported limit; empty for none."""
        limit = self._limit
        if limit is None or limit.setting not in self._names[motor]:
            return ""
        found, highest = self.known[motor][limit.setting], float(limit.highest[motor])
        if math.isclose(found, highest, rel_tol=1e-6):
            return ""
        return f"has {found:g} as its {limit.name}, and does not accept {highest:g}"

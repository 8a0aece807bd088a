"""Diagnostics once a second: state of the supervisor, health of the motors, timing of the loop."""

import math
import struct
from collections.abc import Callable, Iterator

from footfall.deploy.telemetry import messages
from footfall.deploy.telemetry.messages import BAD, FINE, WARNING, Diagnosis

EVERY_NS = 1_000_000_000
STALE_S = 0.05  # age of a reading above which the diagnostics warn
STOPPED, RECOVERING = ("ESTOP", "FALLING"), "RECOVERING"


class Health:
    """Collects and publishes the diagnostics."""

    def __init__(self, robot: str, joints: tuple[str, ...], put: Callable[[str, int, bytes], None]) -> None:
        self._robot, self._joints, self._put = robot, joints, put
        self._next_ns = 0
        self._ages = self._motors = b""
        self._worst_us = [0.0, 0.0]  # work and lateness since the last message
        self._timed = False
        self.state = ""

    def ages(self, numbers: bytes) -> None:
        """Set the ages of the readings."""
        self._ages = numbers

    def motors(self, numbers: bytes) -> None:
        """Set the motors' temperatures, voltages and error codes."""
        self._motors = numbers

    def timing(self, numbers: bytes) -> None:
        """Add a tick's work and lateness, us."""
        self._timed = True
        self._worst_us = [
            max(pair) for pair in zip(self._worst_us, struct.unpack("<2d", numbers), strict=True)
        ]

    def publish(self, time_ns: int) -> None:
        """Publish if due."""
        if time_ns >= self._next_ns:
            self._next_ns = time_ns + EVERY_NS
            self._put("/diagnostics", time_ns, messages.diagnostics(time_ns, self._robot, self._parts()))

    def _parts(self) -> Iterator[Diagnosis]:
        mode, _, fault = self.state.partition(": ")
        level = BAD if mode in STOPPED or fault else FINE
        yield Diagnosis(WARNING if mode == RECOVERING else level, "footfall: state", self.state, {})
        if self._motors:
            yield self._of_motors()
        if self._ages:
            *ages, imu = _numbers(self._ages)
            oldest = max(zip(ages, self._joints, strict=True))
            values = {"oldest joint": f"{oldest[1]} {_short(oldest[0], 's')}", "imu": _short(imu, "s")}
            late = max(oldest[0], imu) > STALE_S
            yield Diagnosis(
                WARNING if late else FINE, "footfall: readings", "old" if late else "current", values
            )
        if self._timed:
            work_us, lateness_us = self._worst_us
            self._worst_us = [0.0, 0.0]
            values = {"longest work": _short(work_us, "us"), "latest tick": _short(lateness_us, "us")}
            yield Diagnosis(FINE, "footfall: loop", "of the last second", values)

    def _of_motors(self) -> Diagnosis:
        count = len(self._joints)
        numbers = _numbers(self._motors)
        temperature, voltage, errors = (numbers[part * count : (part + 1) * count] for part in range(3))
        wrong = [
            f"{name}: error {code:g}" for name, code in zip(self._joints, errors, strict=True) if code > 0
        ]
        values = {}
        known = [pair for pair in zip(temperature, self._joints, strict=True) if not math.isnan(pair[0])]
        if known:
            values["hottest"] = f"{max(known)[1]} {_short(max(known)[0], '°C')}"
        volts = [each for each in voltage if not math.isnan(each)]
        if volts:
            values["lowest supply"] = _short(min(volts), "V")
        return Diagnosis(BAD if wrong else FINE, "footfall: motors", ", ".join(wrong) or "no error", values)


def _numbers(content: bytes) -> tuple[float, ...]:
    return struct.unpack(f"<{len(content) // 8}d", content)


def _short(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}"

"""Operations on a robot's motors without a control loop, for a robot on a stand.

After every operation, even a failed one, the motors are disabled.
"""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.bus import Bus
from footfall.deploy.clock import Clock, WallClock
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring

PERIOD_US = 20_000  # well within the motors' timeout
REPLY_TIMEOUT_S = 2.0  # timeout for motors to report their settings, and to confirm enable
SILENCE_TIMEOUT_US = 500_000
DISABLED_S = 1.0  # motors are disabled for this time before their zero is set
MAX_REST_SPEED_RAD_S = 0.2
REPEATS = 5  # number of frames that disable motors or clear errors, because a frame may be lost
CLEAR_TIMEOUT_S = 0.5  # until no report contains an error: heartbeats come ten times per second
ZERO_TIMEOUT_S = 1.2  # some motors are silent for a second after their zero is set
MAX_ZERO_ERROR_RAD = 0.1  # largest position after setting zero
ZERO_TRIES = 3  # a frame may be lost
# SIGTERM already raises KeyboardInterrupt, and so does SIGINT unless a script started the command with `&`.
END_SIGNALS = (signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)


class MotorState(NamedTuple):
    """Latest state of one motor."""

    joint: str
    bus: str
    id: int
    model: str
    age_s: float  # age of its latest reply; infinite without one
    position: float  # rad
    velocity: float  # rad/s
    torque: float  # N m
    temperature_c: float  # NaN if not reported
    voltage: float  # V; NaN if not reported
    error: str  # text; empty for none


class Bench:
    """Exchanges frames with some motors of a robot at a fixed rate."""

    def __init__(self, wiring: Wiring, bus: Bus, clock: Clock | None = None) -> None:
        """Raises UserError for a motor without a driver."""
        n = len(wiring.motor_id)
        self._wiring, self._bus = wiring, bus
        self._clock = clock or WallClock(PERIOD_US)
        self._driver = open_driver(wiring)
        self._values = np.full((3, n), np.nan)
        self._temperature, self._voltage = np.full((2, n), np.nan)
        self._error = np.zeros(n, np.intp)
        self._arrived_us = np.full(n, -np.inf)
        self._now_us = self._clock.next_tick()

    # -- operations ----------------------------------------------------------------------------------

    def watch(self, seconds: float, each_tick: Callable[[], None]) -> None:
        """Read the motors while they are disabled: most motors reply to the disable frame."""
        self._run(seconds, self._driver.disable, each_tick)

    def query_settings(self) -> str:
        """Read the motors' settings; returns the first problem, or an empty string."""
        self._run(REPLY_TIMEOUT_S, self._driver.query_settings, until=lambda: not self._driver.not_ready())
        return self._driver.not_ready()

    def enable(self) -> str:
        """Enable the motors, without torque; returns the first problem, or an empty string."""
        self._run(
            REPLY_TIMEOUT_S,
            self._driver.enable,
            until=lambda: not (self.missing() or self._driver.not_enabled()),
        )
        return self.missing() or self._driver.not_enabled()

    def idle(self, seconds: float, each_tick: Callable[[], None]) -> None:
        """Keep motors enabled for a time: no stiffness, no damping, no torque."""
        zero_command = np.zeros((5, len(self._arrived_us)))
        self._run(seconds, lambda: self._driver.command(zero_command), each_tick)

    def settle(self) -> str:
        """Wait with disabled motors until no joint moves; returns the first moving or silent one, or
        empty."""
        self._run(DISABLED_S, self._driver.disable)
        self._run(REPLY_TIMEOUT_S, self._driver.disable, until=lambda: not self._unsettled())
        return self._unsettled()

    def _unsettled(self) -> str:
        moving = np.abs(self._values[1]) > MAX_REST_SPEED_RAD_S
        text = f"{self._wiring.label(int(moving.argmax()))} moves" if moving.any() else ""
        return self.missing() or text

    def clear(self) -> str:
        """Clear latched errors; returns why that is impossible, or an empty string."""
        frames = self._driver.clear()
        if not len(frames.id):
            return "these motors have no frame that clears errors: switch their power off and on"
        for _ in range(REPEATS):
            self._exchange(frames)
        self._run(CLEAR_TIMEOUT_S, self._driver.disable)
        return ""

    def zero(self) -> str:
        """Set the motors' zero to their current position; returns the first failure, or an empty string."""
        for _ in range(ZERO_TRIES):
            self._run(0.0, self._driver.zero)
            self._run(ZERO_TIMEOUT_S, self._driver.disable)
            not_zeroed = np.abs(self._values[0]) > MAX_ZERO_ERROR_RAD
            if not not_zeroed.any():
                return ""
        return f"{self._wiring.label(int(not_zeroed.argmax()))} did not set its zero"

    def disable(self) -> None:
        """Disable the motors."""
        for _ in range(REPEATS):
            self._exchange(self._driver.disable())

    # -- queries -------------------------------------------------------------------------------------

    def missing(self) -> str:
        """First silent motor; empty if all reply."""
        silent = self._now_us - self._arrived_us > SILENCE_TIMEOUT_US
        return f"no answer from {self._wiring.label(int(silent.argmax()))}" if silent.any() else ""

    def states(self) -> list[MotorState]:
        """Latest state of each motor."""
        wiring = self._wiring
        columns = zip(
            ((self._now_us - self._arrived_us) * 1e-6).tolist(),
            *self._values.tolist(),
            self._temperature.tolist(),
            self._voltage.tolist(),
            [self._driver.error_name(code, j) if code else "" for j, code in enumerate(self._error.tolist())],
            strict=True,
        )
        return [
            MotorState(
                wiring.joint_names[joint],
                wiring.buses[wiring.channel[joint]],
                int(wiring.motor_id[joint]),
                wiring.models[joint],
                *figures,
            )
            for joint, figures in enumerate(columns)
        ]

    # -- ticks ---------------------------------------------------------------------------------------

    def _run(
        self,
        seconds: float,
        frames: Callable[[], Frames],
        each_tick: Callable[[], None] | None = None,
        until: Callable[[], bool] | None = None,
    ) -> None:
        """Exchange frames for a time, at least for one tick, or until a condition holds.
        Raises UserError for a failing bus.
        """
        end_us = self._now_us + seconds * 1e6
        while True:
            self._exchange(frames())
            if fault := self._bus.fault():
                raise UserError(fault)
            if each_tick is not None:
                each_tick()
            if self._now_us >= end_us or (until is not None and until()):
                return

    def _exchange(self, frames: Frames) -> None:
        """Send frames, wait for the next tick, decode replies."""
        self._bus.send(frames, self._now_us)
        self._now_us = self._clock.next_tick()
        for batch in self._bus.receive(self._now_us):
            motor, values, error, temperature, voltage, *_ = self._driver.replies(batch)
            self._values[:, motor], self._error[motor] = values, error
            self._temperature[motor], self._voltage[motor] = temperature, voltage
            self._arrived_us[motor] = self._now_us


@contextmanager
def disabled_afterwards(bench: Bench) -> Iterator[None]:
    """Disable a bench's motors at the end of the context in any case; no signal interrupts that."""

    def end(*_: object) -> None:
        raise KeyboardInterrupt

    original = {number: signal.signal(number, end) for number in END_SIGNALS}
    try:
        yield
    finally:
        signals = (signal.SIGTERM, *END_SIGNALS)
        active = {number: signal.signal(number, signal.SIG_IGN) for number in signals}
        try:
            bench.disable()
        finally:
            for number, handler in (active | original).items():
                signal.signal(number, handler)

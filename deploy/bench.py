"""A robot's motors on a bus without a control loop: for a robot on a stand, one look or one act at a time.

Whatever ends it, the motors are off afterwards, as far as frames can switch them off.
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

PERIOD_US = 20_000  # well within a motor's time-out
PATIENCE_S = 2.0  # for motors to tell their settings, and to switch on
SILENCE_US = 500_000
SETTLE_S = 1.0  # motors off, before a zero is set
STILL_RAD_S = 0.2
TELL_TICKS = 5  # how often motors are told to switch off, or to forget errors: a frame may be lost
CLEAR_S = 0.5  # until a motor has said that it has no error any more: heartbeats come ten times a second
ZERO_S = 1.2  # some motors say nothing for a second after their zero was set
ZERO_RAD = 0.1  # from zero, at most, once that was set
ZERO_TRIES = 3  # a frame may be lost
HANGING_UP = (
    signal.SIGHUP,
    signal.SIGQUIT,
)  # beside Ctrl-C and SIGTERM, which raise KeyboardInterrupt anyway


class MotorState(NamedTuple):
    """What is known of one motor."""

    joint: str
    bus: str
    id: int
    model: str
    age_s: float  # since it was heard; infinite if it never was
    position: float  # rad
    velocity: float  # rad/s
    torque: float  # N m
    temperature_c: float  # NaN where it does not say
    voltage: float  # V; NaN where it does not say
    error: str  # in words; empty for none


class Bench:
    """Some motors of a robot, spoken to at a steady rate."""

    def __init__(self, wiring: Wiring, bus: Bus, clock: Clock | None = None) -> None:
        """Raises UserError for a motor that no driver knows."""
        n = len(wiring.motor_id)
        self._wiring, self._bus = wiring, bus
        self._clock = clock or WallClock(PERIOD_US)
        self._driver = open_driver(wiring)
        self._values = np.full((3, n), np.nan)
        self._temperature, self._voltage = np.full((2, n), np.nan)
        self._error = np.zeros(n, np.intp)
        self._heard_us = np.full(n, -np.inf)
        self._now_us = self._clock.next_tick()

    # -- what it does --------------------------------------------------------------------------------

    def watch(self, seconds: float, each_tick: Callable[[], None]) -> None:
        """Let the motors report while they are off: the frame that switches them off is answered by most."""
        self._run(seconds, self._driver.disable, each_tick)

    def query_settings(self) -> str:
        """Ask the motors for their settings; what is wrong with them, or missing, empty if nothing."""
        self._run(PATIENCE_S, self._driver.query_settings, until=lambda: not self._driver.not_ready())
        return self._driver.not_ready()

    def enable(self) -> str:
        """Switch the motors on, without torque; who did not, or empty."""
        self._run(
            PATIENCE_S, self._driver.enable, until=lambda: not (self.missing() or self._driver.not_enabled())
        )
        return self.missing() or self._driver.not_enabled()

    def idle(self, seconds: float, each_tick: Callable[[], None]) -> None:
        """Motors that are on stay on for a time: no stiffness, no damping, no torque."""
        nothing = np.zeros((5, len(self._heard_us)))
        self._run(seconds, lambda: self._driver.command(nothing), each_tick)

    def settle(self) -> str:
        """Wait, motors off, until no joint moves; which one still does after a while, or does not answer."""
        self._run(SETTLE_S, self._driver.disable)
        self._run(PATIENCE_S, self._driver.disable, until=lambda: not self._unsettled())
        return self._unsettled()

    def _unsettled(self) -> str:
        moving = np.abs(self._values[1]) > STILL_RAD_S
        moves = f"{self._wiring.place(int(moving.argmax()))} moves" if moving.any() else ""
        return self.missing() or moves

    def clear(self) -> str:
        """Let motors forget the errors that they have latched; why that cannot be, or empty."""
        frames = self._driver.clear()
        if not len(frames.id):
            return "no motor here knows a frame that clears errors: switch their power off and on"
        for _ in range(TELL_TICKS):
            self._exchange(frames)
        self._run(CLEAR_S, self._driver.disable)
        return ""

    def zero(self) -> str:
        """Motors take their present position for zero; which one does not, or empty."""
        for _ in range(ZERO_TRIES):
            self._run(0.0, self._driver.zero)
            self._run(ZERO_S, self._driver.disable)
            elsewhere = np.abs(self._values[0]) > ZERO_RAD
            if not elsewhere.any():
                return ""
        return f"{self._wiring.place(int(elsewhere.argmax()))} did not take its position for zero"

    def disable(self) -> None:
        """Switch the motors off."""
        for _ in range(TELL_TICKS):
            self._exchange(self._driver.disable())

    # -- what it knows -------------------------------------------------------------------------------

    def missing(self) -> str:
        """Which motor was not heard lately."""
        silent = self._now_us - self._heard_us > SILENCE_US
        return f"no answer from {self._wiring.place(int(silent.argmax()))}" if silent.any() else ""

    def states(self) -> list[MotorState]:
        """What is known of each motor."""
        wiring = self._wiring
        columns = zip(
            ((self._now_us - self._heard_us) * 1e-6).tolist(),
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
        """Exchange frames for a time, one tick at least, or until something is so.

        Raises UserError for a bus that does not work.
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
        """Send frames, wait for a tick, take in what has come."""
        self._bus.send(frames, self._now_us)
        self._now_us = self._clock.next_tick()
        for batch in self._bus.receive(self._now_us):
            motor, values, error, temperature, voltage, _ = self._driver.replies(batch)
            self._values[:, motor], self._error[motor] = values, error
            self._temperature[motor], self._voltage[motor] = temperature, voltage
            self._heard_us[motor] = self._now_us


@contextmanager
def switched_off_afterwards(bench: Bench) -> Iterator[None]:
    """Switch a bench's motors off when the context ends, however it does; no signal cuts that short."""

    def end(*_: object) -> None:
        raise KeyboardInterrupt

    before = {number: signal.signal(number, end) for number in HANGING_UP}
    try:
        yield
    finally:
        endings = (signal.SIGINT, signal.SIGTERM, *HANGING_UP)
        held = {number: signal.signal(number, signal.SIG_IGN) for number in endings}
        try:
            bench.disable()
        finally:
            for number, handler in (held | before).items():
                signal.signal(number, handler)

"""Fallback after a failed tick: damping frames without readings, then disabled motors."""

import traceback
from contextlib import suppress
from itertools import cycle
from pathlib import Path

import numpy as np

from footfall.deploy.bus import Bus
from footfall.deploy.clock import Clock
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.frames import Frames
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.wiring import Wiring

MIN_TORQUE_SHARE = 0.03  # of the peak torque: above the report of a motor without current
DISABLE_TIMEOUT_US = 250_000  # time limit for disabling motors: two heartbeats, by which some confirm it


class LastResort:
    """Damps a robot and disables its motors, whatever happened before."""

    def __init__(
        self,
        driver: Driver,
        bus: Bus,
        clock: Clock,
        joints: JointLayer,
        wiring: Wiring,
        damping_kd: float,
        tick_us: int,
    ) -> None:
        """Prepare the frames for `damping_kd`, N m s/rad, while everything works."""
        self._driver, self._bus, self._clock, self._joints = driver, bus, clock, joints
        self._wiring, self._kd, self._tick_us = wiring, damping_kd, tick_us
        self._frames = cycle(driver.damping(np.full(len(wiring.joint_names), damping_kd)))
        self._reduced = False  # whether the damping was reduced to what motors can brake at their speeds
        self.silent_at_the_end: list[str] = []  # motors that did not reply when they were disabled
        self.on_at_the_end: list[str] = []  # motors that replied, but are enabled or report torque

    def damping(self) -> Frames:
        """Frames that damp without readings, reduced to what motors can brake at their last speeds.

        If this cannot be computed, the frames are the prepared ones.
        """
        if not self._reduced:
            self._reduced = True
            with suppress(BaseException):
                self._frames = cycle(self._driver.damping(self._joints.possible_damping(self._kd)))
        return next(self._frames)

    def send(self, over: bool, now_us: int) -> None:
        """Send damping, or once the run is `over` frames that disable the motors. Raises nothing."""
        with suppress(BaseException):
            self._bus.send(self._driver.disable() if over else self.damping(), now_us)

    def disable(self) -> None:
        """Disable the motors repeatedly, until each has replied.

        Any reply from two ticks after the first request on is a confirmation, because nothing else is sent. A
        motor that reports its state must confirm disable, and no motor may report torque. Ends after
        `DISABLE_TIMEOUT_US`: a motor without a reply is then in `silent_at_the_end`, an enabled one in
        `on_at_the_end`.
        """
        began_us = now_us = self._clock.next_tick()
        while now_us - began_us <= DISABLE_TIMEOUT_US:
            with suppress(BaseException):
                self._joints.absorb(self._bus.receive(now_us), now_us)
            unanswered = self._joints.last_arrivals().motor_us < began_us + 2 * self._tick_us
            has_torque = self._joints.torque_share > MIN_TORQUE_SHARE
            on = ~unanswered & (self._driver.not_confirmed_off() | has_torque)
            self.silent_at_the_end, self.on_at_the_end = self._labels(unanswered), self._labels(on)
            if not self.silent_at_the_end and not self.on_at_the_end:
                return
            with suppress(BaseException):
                self._bus.send(self._driver.disable(), now_us)
            now_us = self._clock.next_tick()

    def _labels(self, joints: np.ndarray) -> list[str]:
        return [self._wiring.label(int(joint)) for joint in np.flatnonzero(joints)]


def in_one_line(error: BaseException) -> str:
    """An exception in one line, with its position in the source."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    text = ": ".join(filter(None, [type(error).__name__, " ".join(str(error).split())]))
    return f"{text} ({Path(last.filename).name}, line {last.lineno})"

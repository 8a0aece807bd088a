"""Delays and lost frames of the simulated robot, which may change within an episode."""

from collections import deque
from typing import Generic, TypeVar

import numpy as np

from footfall.deploy.frames import Frames
from footfall.domain_rand.quantity import Direction
from footfall.domain_rand.sample import Sample
from footfall.domain_rand.transport import JITTER_PERIOD_S, delay_now_s, transport_of

T = TypeVar("T")

SEEDS: dict[Direction, int] = {"actions": 0xAC7, "readings": 0x2EAD}  # combined with an episode's seed


class Delay:
    """Delay of commands or of readings, in physics steps."""

    def __init__(self, sample: Sample, direction: Direction, step_s: float, seed: int) -> None:
        self._transport, self._step_s = transport_of(sample, direction), step_s
        self._random = np.random.default_rng([seed, SEEDS[direction]])
        self._jitter_steps = round(JITTER_PERIOD_S / step_s)  # how long a drawn jitter lasts
        self._jitter, self._jitter_until = 0.0, 0
        transport = self._transport
        self.varies = transport.jitter_s is not None or transport.swing_s is not None
        parts = (transport.delay_s, transport.jitter_s, transport.swing_s)
        self.max_steps = round(sum(float(part) for part in parts if part is not None) / step_s)
        self._constant = self.max_steps  # delay in steps, unless it varies

    def steps(self, step: int) -> int:
        """Delay of a frame that is sent in a physics step; `step` must not decrease between calls."""
        if not self.varies:
            return self._constant
        if self._transport.jitter_s is not None and step >= self._jitter_until:
            self._jitter = float(self._random.random())
            self._jitter_until = step - step % self._jitter_steps + self._jitter_steps
        return round(float(delay_now_s(self._transport, step * self._step_s, self._jitter)) / self._step_s)


class DelayLine(Generic[T]):
    """The recent true values of sensors, from which the delayed ones are taken."""

    def __init__(self, sample: Sample, step_s: float, seed: int) -> None:
        self._delay = Delay(sample, "readings", step_s, seed)
        self._moments: deque[T] = deque(maxlen=self._delay.max_steps + 1)
        self._newest_step = self._delayed_step = -1  # steps

    def push(self, moment: T) -> None:
        """Store the current values. Call at each physics step."""
        self._moments.append(moment)
        self._newest_step += 1

    def delayed(self) -> T:
        """The values that are reported now, never older than the values of the last call."""
        if not self._delay.varies:
            return self._moments[0]
        self._delayed_step = max(self._delayed_step, self._newest_step - self._delay.steps(self._newest_step))
        return self._moments[max(self._delayed_step - self._newest_step - 1, -len(self._moments))]


class Losses:
    """Loses frames of one direction."""

    def __init__(self, sample: Sample, direction: Direction, seed: int) -> None:
        lost = transport_of(sample, direction).lost
        self.share = 0.0 if lost is None else float(lost)  # of the frames
        self._random = np.random.default_rng([seed, SEEDS[direction], 1])

    def pass_on(self, frames: Frames) -> Frames:
        """The frames that arrive."""
        return frames.take(self._random.random(len(frames.id)) >= self.share)

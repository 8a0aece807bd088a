"""Delays of commands and readings that change within an episode.

`Randomisation` declares the ranges. In training (JAX) a lost frame becomes a delay until the next frame; the
simulated robot (NumPy) loses the frame itself.
"""

from typing import Any, NamedTuple

import numpy as np

from footfall.common.arrays import library
from footfall.domain_rand.quantity import Direction
from footfall.domain_rand.sample import Sample, changed

Array = Any  # a NumPy or a JAX array

SWING_PERIOD_S = 4.0  # period in which a delay rises by its swing and falls back
JITTER_PERIOD_S = 0.02  # how long the simulated robot keeps a drawn jitter: a control step at 50 Hz
FRAME_PERIOD_S = 0.002  # between two frames of a motor: the deploy loop's default joint rate


class Transport(NamedTuple):
    """Delay and loss of commands, or of readings, on a robot. None: the effect is absent."""

    delay_s: Array | None = None  # constant in an episode
    jitter_s: Array | None = None  # largest extra delay, drawn for each control step
    swing_s: Array | None = None  # amplitude of the delay's rise and fall in `SWING_PERIOD_S`
    lost: Array | None = None  # share of the frames that never arrive

    @property
    def varies(self) -> bool:
        """Whether the delay changes within an episode."""
        return any(part is not None for part in (self.jitter_s, self.swing_s, self.lost))


def transport_of(sample: Sample, direction: Direction) -> Transport:
    """The transport of the sampled robot's actions or readings."""
    return changed(Transport(), sample, direction)


def swing_share(time_s: Array | float) -> Array:
    """Share of the swing at a time of an episode, 0 to 1 and back: a triangle wave."""
    return 1.0 - abs(1.0 - 2.0 * (time_s / SWING_PERIOD_S % 1.0))


def delay_now_s(transport: Transport, time_s: Array | float, jitter: Array | float) -> Array | float:
    """Delay of a frame that is sent at a time of an episode and is not lost, s.

    Args:
        transport: transport of the sampled robot.
        time_s: time since the beginning of the episode.
        jitter: uniform number in [0, 1).
    """
    delay_s: Array | float = 0.0 if transport.delay_s is None else transport.delay_s
    if transport.swing_s is not None:
        delay_s = delay_s + transport.swing_s * swing_share(time_s)
    if transport.jitter_s is not None:
        delay_s = delay_s + transport.jitter_s * jitter
    return delay_s


def waiting_s(lost: Array, u: Array) -> Array:
    """Time until a frame arrives, s: k frames in a row are lost with probability `lost` ** k.

    Args:
        lost: share of the frames that never arrive, below 1.
        u: uniform numbers in [0, 1), of any shape.
    """
    xp = library(u)
    with np.errstate(divide="ignore"):  # log(0), if no frames are lost
        return FRAME_PERIOD_S * xp.floor(xp.log(1.0 - u) / xp.log(lost))

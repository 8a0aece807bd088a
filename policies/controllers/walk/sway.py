"""How the body sways, so that its weight presses between the feet that stand."""

import cmath
import math
from typing import NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.gait import GaitTiming, in_stance, leg_phases

_CLOCKS = np.arange(240) / 240
_SETTLES = 16.0  # time constants in a cycle, of each of two filters: a sway is there after a quarter of it
_BEFORE = 0.02  # of a cycle, ahead of the turn, where a foot lifts off


class SwayPlan(NamedTuple):
    """Sways along a sine, once in each cycle of the gait: amplitude and phase as complex numbers."""

    body: np.ndarray  # (2,) m forward and leftward, of the body
    pressure: np.ndarray  # (2,) the same, of the centre of pressure

    def start(self, clock: float) -> float:
        """Where to let the gait's clock begin, in cycles: the body is about to turn back, and hardly moves.

        Without a sway it begins where it is.
        """
        farthest = self.body[np.argmax(np.abs(self.body))]
        return (-cmath.phase(farthest) / (2.0 * math.pi) - _BEFORE) % 1.0 if farthest else clock


def sine_at(sine: np.ndarray, clock: np.ndarray | float) -> np.ndarray:
    """Value (..., 2) of a sine (2,) at times of the gait's clock (...), in cycles."""
    turned: np.ndarray = np.multiply.outer(np.exp(2j * math.pi * np.asarray(clock)), sine)
    return turned.real


def plan_sway(
    places: np.ndarray, timing: GaitTiming, offsets: np.ndarray, height_m: float, share: float
) -> SwayPlan:
    """The sway that brings the centre of pressure towards the middle of the feet that stand.

    That middle jumps from step to step; the pressure follows the first sine in its Fourier series. A body
    whose centre of mass is at c and h above the ground presses at p = c - h c'' / g (the cart on a table of
    Kajita et al. 2003, "Biped walking pattern generation by using preview control of zero-moment point"), so
    for a sine of p it sways by p / (1 + w^2 h / g): in a slow gait it is where it presses, in a fast one it
    hardly moves.

    Args:
        places: (feet, 2) m, in the middle of each stance.
        timing, offsets: of the gait.
        height_m: of the centre of mass above the ground.
        share: of that sine.
    """
    stands = in_stance(leg_phases(_CLOCKS[:, None], offsets), timing.duty)
    middle = stands @ places / np.maximum(stands.sum(axis=1, keepdims=True), 1)
    pressure = 2.0 * share * (np.exp(-2j * math.pi * _CLOCKS) @ middle) / len(_CLOCKS)
    rate = 2.0 * math.pi / timing.period_s
    return SwayPlan(pressure / (1.0 + rate**2 * height_m / GRAVITY_M_S2), pressure)


class Sway:
    """A sway that begins, changes and ends without a jump. In Python's own numbers, as feet are."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """No sway."""
        self._first = self._now = [0j, 0j]

    def approach(self, goal: np.ndarray, cycles: float) -> None:
        """Towards the sine (2,) of a body over a part of a gait's cycle."""
        share = min(1.0, _SETTLES * cycles)
        self._first = _nearer(self._first, goal.tolist(), share)
        self._now = _nearer(self._now, self._first, share)

    def misses(self, goal: np.ndarray) -> float:
        """How far it is at most from a body's sine, m."""
        return max(abs(now - wanted) for now, wanted in zip(self._now, goal.tolist(), strict=True))

    def at(self, clock: float) -> tuple[float, float]:
        """Of the body, forward and leftward, m."""
        turn, (forward, leftward) = cmath.exp(2j * math.pi * clock), self._now  # as in `sine_at`
        return (turn * forward).real, (turn * leftward).real


def _nearer(now: list[complex], goal: list[complex], share: float) -> list[complex]:
    return [part + share * (wanted - part) for part, wanted in zip(now, goal, strict=True)]

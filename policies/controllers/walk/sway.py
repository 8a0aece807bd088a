"""Sway of the body that keeps its weight between the stance feet."""

import cmath
import math
from typing import NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.gait import GaitTiming, in_stance, leg_phases

_CLOCKS = np.arange(240) / 240
_FILTER_RATE = 16.0  # time constants per cycle of each of two filters: a sway is reached after 1/4 cycle
_LEAD_CYCLES = 0.02  # cycles between a lift-off and the reversal of the sway


class SwayPlan(NamedTuple):
    """Sinusoidal sway, once per cycle of the gait: amplitude and phase as complex numbers."""

    body: np.ndarray  # (2,) m, sway of the body, forward and leftward
    pressure: np.ndarray  # (2,) m, sway of the centre of pressure

    def start(self, clock: float) -> float:
        """Phase at which the gait's clock should start, in cycles: shortly before the body's reversal, where
        it hardly moves. Without a sway the phase stays the same.
        """
        largest = self.body[np.argmax(np.abs(self.body))]
        return (-cmath.phase(largest) / (2.0 * math.pi) - _LEAD_CYCLES) % 1.0 if largest else clock


def sine_at(sine: np.ndarray, clock: np.ndarray | float) -> np.ndarray:
    """Value (..., 2) of a sine (2,) at phases of the gait's clock (...), in cycles."""
    value: np.ndarray = np.multiply.outer(np.exp(2j * math.pi * np.asarray(clock)), sine)
    return value.real


def plan_sway(
    positions: np.ndarray, timing: GaitTiming, offsets: np.ndarray, height_m: float, share: float
) -> SwayPlan:
    """Sway that moves the centre of pressure towards the middle of the stance feet.

    That middle jumps from step to step; the pressure follows the first sine of its Fourier series. For a
    centre of mass at c, at a height h above the ground, the centre of pressure is p = c - h c'' / g
    (cart-table model of Kajita et al. 2003, "Biped walking pattern generation by using preview control of
    zero-moment point"). So for a sine of p the body sways by p / (1 + w^2 h / g): in a slow gait it stays
    above p, in a fast gait it hardly moves.

    Args:
        positions: (feet, 2) m, positions at mid-stance.
        timing, offsets: timing and phase offsets of the gait.
        height_m: height of the centre of mass above the ground.
        share: factor of that sine.
    """
    stands = in_stance(leg_phases(_CLOCKS[:, None], offsets), timing.duty)
    middle = stands @ positions / np.maximum(stands.sum(axis=1, keepdims=True), 1)
    pressure = 2.0 * share * (np.exp(-2j * math.pi * _CLOCKS) @ middle) / len(_CLOCKS)
    rate = 2.0 * math.pi / timing.period_s
    return SwayPlan(pressure / (1.0 + rate**2 * height_m / GRAVITY_M_S2), pressure)


class Sway:
    """A sway that starts, changes and ends without a jump, in Python floats."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start without a sway."""
        self._filtered_once = self._filtered_twice = [0j, 0j]

    def approach(self, goal: np.ndarray, cycles: float) -> None:
        """Move towards the body's sine (2,), during a part of a cycle."""
        share = min(1.0, _FILTER_RATE * cycles)
        self._filtered_once = _nearer(self._filtered_once, goal.tolist(), share)
        self._filtered_twice = _nearer(self._filtered_twice, self._filtered_once, share)

    def distance(self, goal: np.ndarray) -> float:
        """Largest distance from a body's sine, m."""
        return max(
            abs(now - desired) for now, desired in zip(self._filtered_twice, goal.tolist(), strict=True)
        )

    def at(self, clock: float) -> tuple[float, float]:
        """Sway of the body, forward and leftward, m."""
        turn, (forward, leftward) = cmath.exp(2j * math.pi * clock), self._filtered_twice  # as in `sine_at`
        return (turn * forward).real, (turn * leftward).real


def _nearer(now: list[complex], goal: list[complex], share: float) -> list[complex]:
    return [part + share * (desired - part) for part, desired in zip(now, goal, strict=True)]

"""Wiring mistakes, and the torque responses that result from each."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from footfall.deploy.wiring import Wiring

RATIOS = (0.6, 0.8, 1.25, 1.5)  # possible actual gear ratios relative to the assumed ones
IN_MOTOR = "correct it in the motor's own settings"


class Cause(NamedTuple):
    """A possible wiring: the joint moved by each motor, and the turns reported per turn of the joint."""

    text: str  # mistake and remedy
    joint: np.ndarray  # (n,) joints moved by the motors that should move joint 0, 1, ...
    ratio: np.ndarray  # (n,) reported turns per actual turn; negative for a reversed motor
    key: tuple[int, ...] = ()  # affected joints

    def units(self, highest: np.ndarray) -> np.ndarray:
        """Value that each motor decodes from a frame that encodes 1, (5, n): the rows of a `JointCommand`.

        A frame encodes shares of a motor's ranges. A motor in the place of another one decodes with its own.

        Args:
            highest: (5, n) ends of the ranges, infinite for values that are not shares.
        """
        own = highest[:, self.joint]
        shares = np.isfinite(own) & np.isfinite(highest)
        return np.divide(own, highest, out=np.ones_like(highest), where=shares)

    def responses(self, expected: np.ndarray, highest: np.ndarray) -> np.ndarray:
        """Torque responses (n, n) to the same motions, if everything else is unchanged.

        Args:
            expected: (n, n) responses with the wiring in `robot.yaml`.
            highest: see `units`.
        """
        position, *_, torque = self.units(highest)
        moved, reported = position / self.ratio, 1.0 / (torque * self.ratio)
        return expected[np.ix_(self.joint, self.joint)] * np.outer(moved, reported)


def as_wired(joints: int) -> Cause:
    """The wiring in `robot.yaml`."""
    return Cause("", np.arange(joints), np.ones(joints))


def causes(wiring: Wiring, legs: Sequence[np.ndarray]) -> Iterator[Cause]:
    """All single mistakes: exchanged buses, legs or motors, a reversed motor, a wrong gear ratio.

    Legs are given by their joints, from the base outwards.
    """
    n = len(wiring.motor_id)
    labels = [wiring.label(joint) for joint in range(n)]
    ones, order = np.ones(n), np.arange(n)
    used = sorted(set(wiring.channel.tolist()))
    for first, second in combinations(used, 2):
        joint = _buses_exchanged(wiring, first, second)
        if joint is not None:
            text = f"{wiring.buses[first]} and {wiring.buses[second]} are exchanged: swap their connectors"
            yield Cause(text, joint, ones, tuple(np.flatnonzero(joint != order).tolist()))
    for one, other in combinations(legs, 2):
        if len(one) == len(other):
            joint = order.copy()
            joint[one], joint[other] = other, one
            text = f"the leg of {labels[one[0]]} and that of {labels[other[0]]} are exchanged: swap all plugs"
            yield Cause(text, joint, ones, (*one.tolist(), *other.tolist()))
    for first, second in combinations(range(n), 2):
        joint = order.copy()
        joint[[first, second]] = second, first
        text = f"{labels[first]} and {labels[second]} are exchanged: swap their plugs or their ids"
        yield Cause(text, joint, ones, (first, second))
    for moved in range(n):
        for ratio in (-1.0, *RATIOS):
            ratios = ones.copy()
            ratios[moved] = ratio
            yield Cause(_about_gears(labels[moved], ratio), order, ratios, (moved,))


def _about_gears(label: str, ratio: float) -> str:
    if ratio < 0.0:
        return f"{label} turns in the opposite direction: {IN_MOTOR}"
    return f"{label} turns {1.0 / ratio:.2g} times as far as it reports: its gear ratio is wrong: {IN_MOTOR}"


def _buses_exchanged(wiring: Wiring, first: int, second: int) -> np.ndarray | None:
    """Joint of the motor that receives each motor's messages; None if an id exists on only one of the
    buses."""
    at = {(int(c), int(i)): j for j, (c, i) in enumerate(zip(wiring.channel, wiring.motor_id, strict=True))}
    other = {first: second, second: first}
    joints = [at.get((other.get(c, c), i)) for c, i in at]
    return None if None in joints else np.array(joints)


def turn_about_z(measured: np.ndarray, expected: np.ndarray) -> float:
    """Rotation of an IMU about the base's z axis, rad, from the tilts (n, 2) measured by it and of a
    model."""
    cross = float((expected[:, 0] * measured[:, 1] - expected[:, 1] * measured[:, 0]).sum())
    return -float(np.arctan2(cross, float((expected * measured).sum())))


def turned_back(measured: np.ndarray, angle_rad: float) -> np.ndarray:
    """Tilts (n, 2) in base axes, from those of an IMU that is rotated about z."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return measured @ np.array([[c, s], [-s, c]])

"""A machine of one link on some hinges."""

from collections.abc import Sequence

import numpy as np

from footfall.robots.importer.machine import Hinge, Leg, Link, Machine

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def rod_machine(hinges: Sequence[Hinge], legs: tuple[Leg, ...] = ()) -> Machine:
    """A base of 5 kg and a link of 3 kg with some hinges."""
    link = Link("link", 0, np.zeros(3), LEVEL, 3.0, np.zeros(3), np.eye(3), tuple(hinges), ())
    base = Link("base", -1, np.zeros(3), LEVEL, 5.0, np.zeros(3), np.eye(3), (), ())
    return Machine("m", (base, link), legs, np.zeros(3))


def hinge(name: str, span: float = 2.0) -> Hinge:
    axis, lower, upper = np.array([0.0, 1.0, 0.0]), -0.25 * span, 0.75 * span
    return Hinge(name, axis, np.zeros(3), lower, upper, 0.0, 0.01, 0.0, 0.0)

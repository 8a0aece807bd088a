"""Mirror images of observations and actions.

A robot that is the same left and right, on flat ground, has a mirror image of every transition, and the
image is as good a sample as the transition itself (Mittal et al., "Symmetry considerations for learning task
symmetric robot policies", 2024).
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from footfall.policies.gaits import find_gait
from footfall.robots.description import Robot
from footfall.robots.kinds import Kind
from footfall.robots.symmetry import Mirror, find_symmetry


class EnvironmentMirror(NamedTuple):
    """Mirror maps of observations and action."""

    observation: dict[str, Mirror]
    action: Mirror


def environment_mirror(
    robot: Robot, gait: str | None, layout: Mapping[str, Sequence[Kind]]
) -> EnvironmentMirror:
    """The mirror maps of an environment.

    Args:
        robot: the robot.
        gait: name of its gait, if it has one.
        layout: the kinds of numbers that are concatenated in each observation.

    Raises:
        UserError: the robot or its gait has no mirror image.
    """
    symmetry = find_symmetry(robot, find_gait(gait, robot).phase if gait else None)
    observation = {name: _join([kind.mirror(symmetry) for kind in kinds]) for name, kinds in layout.items()}
    return EnvironmentMirror(observation, symmetry.joints)


def _join(mirrors: list[Mirror]) -> Mirror:
    """The mirror of concatenated vectors."""
    starts = np.cumsum([0] + [len(mirror.source) for mirror in mirrors])
    source = [mirror.source + start for mirror, start in zip(mirrors, starts, strict=False)]
    return Mirror(np.concatenate(source), np.concatenate([mirror.sign for mirror in mirrors]))

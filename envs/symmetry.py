"""What an episode looks like in a mirror: maps of the observations and of the action.

A robot that is the same left and right, on flat ground, has a mirror image of every transition that is
worth as much as the transition itself (Mittal et al., "Symmetry considerations for learning task symmetric
robot policies", 2024).
"""

from typing import NamedTuple

import numpy as np

from footfall.envs.config import EnvConfig
from footfall.envs.critic import actor_kinds, critic_kinds
from footfall.policies.contract import Contract
from footfall.policies.gaits import find_gait
from footfall.robots.description import Robot
from footfall.robots.symmetry import Mirror, find_symmetry


class EnvironmentMirror(NamedTuple):
    """Mirror images of what the learner sees and does."""

    observation: dict[str, Mirror]
    action: Mirror


def environment_mirror(robot: Robot, config: EnvConfig, contract: Contract) -> EnvironmentMirror:
    """The mirror maps of a velocity environment.

    Raises:
        UserError: the robot or its gait has no mirror image.
    """
    gait = find_gait(config.gait.name, robot) if config.gait else None
    symmetry = find_symmetry(robot, gait.phase if gait else None)
    layout = {
        "state": actor_kinds(contract),
        "privileged_state": critic_kinds(contract, config.randomisation),
    }
    observation = {name: _join([kind.mirror(symmetry) for kind in parts]) for name, parts in layout.items()}
    return EnvironmentMirror(observation, symmetry.joints)


def _join(mirrors: list[Mirror]) -> Mirror:
    """The mirror of vectors that are laid end to end."""
    starts = np.cumsum([0] + [len(mirror.source) for mirror in mirrors])
    source = [mirror.source + start for mirror, start in zip(mirrors, starts, strict=False)]
    return Mirror(np.concatenate(source), np.concatenate([mirror.sign for mirror in mirrors]))

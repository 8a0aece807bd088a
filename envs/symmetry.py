"""What an episode looks like in a mirror: maps of the observations and of the action.

A robot that is the same left and right, on flat ground, has a mirror image of every transition that is
worth as much as the transition itself (Mittal et al., "Symmetry considerations for learning task symmetric
robot policies", 2024).
"""

from dataclasses import fields
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.domain_rand.randomisation import Randomisation, sample_shapes
from footfall.envs.config import EnvConfig
from footfall.policies.contract import Contract
from footfall.robots.description import Robot
from footfall.robots.symmetry import ROTATION, VECTOR, Mirror, Symmetry, find_symmetry

HALF_CYCLE = 0.5
SIGNED_JOINT_FIELDS = {"encoder_bias"}  # of a sample; its other joint fields are scales
VECTOR_FIELDS = {"com_offset_m": VECTOR, "gravity_bias": VECTOR, "gyro_bias": ROTATION}


class EnvironmentMirror(NamedTuple):
    """Mirror images of what the learner sees and does."""

    observation: dict[str, Mirror]
    action: Mirror


def environment_mirror(robot: Robot, config: EnvConfig, contract: Contract) -> EnvironmentMirror:
    """The mirror maps of a velocity environment.

    Raises:
        UserError: the robot or its gait has no mirror image.
    """
    symmetry = find_symmetry(robot)
    joints, feet = symmetry.joints, Mirror(symmetry.feet, np.ones(len(symmetry.feet)))
    terms = _term_mirrors(robot, symmetry)
    observed = _join([terms[term.name] for term in contract.observation for _ in range(term.history)])
    clean = _join([terms[term.name] for term in contract.observation])
    # In the order of VelocityEnv's privileged observation.
    privileged = [observed, clean, _signs(VECTOR), _signs(np.ones(1)), feet, feet, joints]
    privileged += _sample_mirrors(config.randomisation, symmetry)
    return EnvironmentMirror({"state": observed, "privileged_state": _join(privileged)}, joints)


def _term_mirrors(robot: Robot, symmetry: Symmetry) -> dict[str, Mirror]:
    """The mirror of each term of an observation frame."""
    joints = symmetry.joints
    return {
        "gyro": _signs(ROTATION),
        "gravity": _signs(VECTOR),
        "command": _signs(np.array([1.0, -1.0, -1.0])),
        "joint_position": joints,
        "joint_velocity": joints,
        "last_action": joints,
        "clock": _signs(np.full(2, _clock_sign(robot, symmetry))),
    }


def _clock_sign(robot: Robot, symmetry: Symmetry) -> float:
    """Where partners step half a cycle apart, the mirror changes the sign of the clock's sine and cosine."""
    phase = np.array([foot.phase for foot in robot.description.feet])
    apart = (phase[symmetry.feet] - phase) % 1.0
    if np.allclose(apart, HALF_CYCLE):
        return -1.0
    if np.allclose(apart, 0.0):
        return 1.0
    raise UserError(f"robot '{robot.name}': its feet's phases have no mirror image; turn ppo.symmetry off")


def _sample_mirrors(randomisation: Randomisation, symmetry: Symmetry) -> list[Mirror]:
    """The mirrors of a sample's fields, absent ones left out."""
    joints = symmetry.joints
    scales = Mirror(joints.source, np.ones(len(joints.source)))
    bodies = Mirror(symmetry.bodies, np.ones(len(symmetry.bodies)))
    shapes = sample_shapes(len(joints.source), len(symmetry.bodies))
    mirrors = []
    for field in fields(randomisation):
        name = field.name
        if getattr(randomisation, name) is None:
            continue
        if name in VECTOR_FIELDS:
            mirrors.append(_signs(VECTOR_FIELDS[name]))
        elif not shapes[name]:
            mirrors.append(_signs(np.ones(1)))
        elif name in ("link_mass", "inertia"):
            mirrors.append(bodies)
        else:
            mirrors.append(joints if name in SIGNED_JOINT_FIELDS else scales)
    return mirrors


def _signs(sign: np.ndarray) -> Mirror:
    return Mirror(np.arange(len(sign)), sign)


def _join(mirrors: list[Mirror]) -> Mirror:
    """The mirror of vectors that are laid end to end."""
    starts = np.cumsum([0] + [len(mirror.source) for mirror in mirrors])
    source = [mirror.source + start for mirror, start in zip(mirrors, starts, strict=False)]
    return Mirror(np.concatenate(source), np.concatenate([mirror.sign for mirror in mirrors]))

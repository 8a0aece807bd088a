"""Maps each body of a model to its leg."""

from collections import Counter
from collections.abc import Sequence

import mujoco
import numpy as np

NO_LEG = -1


def leg_of_bodies(model: mujoco.MjModel, legs: Sequence[Sequence[str]]) -> np.ndarray:
    """The leg of each body, (nbody,): an index into `legs`, or `NO_LEG`.

    A leg consists of the bodies that its joints move. A body that several legs move belongs to none.

    Args:
        model: compiled, with all of the joints.
        legs: the joints of each leg, by name.
    """
    uses = Counter(joint for joints in legs for joint in joints)
    leg_of_body = np.full(model.nbody, NO_LEG)
    for leg, joints in enumerate(legs):
        own_bodies = [int(model.joint(joint).bodyid[0]) for joint in joints if uses[joint] == 1]
        leg_of_body[own_bodies] = leg
    for body in range(1, model.nbody):  # parents come first
        if leg_of_body[body] == NO_LEG:
            leg_of_body[body] = leg_of_body[model.body_parentid[body]]
    return leg_of_body

"""A robot's model as a tree of hinges under a free base, and the reasons why a model cannot be generated.

Each hinge carries a link. A link's frame has its origin at the hinge's anchor and the axes of the hinge's
body; the base's frame is its body's. Bodies without a joint lie on the link of their parent. Several hinges
of one body are links one after the other, the last of which carries the body.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

PYRAMIDAL = mujoco.mjtCone.mjCONE_PYRAMIDAL
MAX_ITERATIONS = 8  # each makes the program longer
HINGE = mujoco.mjtJoint.mjJNT_HINGE
BASE = -1  # the base's index among the links
BASE_DOFS = 6
ROUNDING = 1e-14  # largest error of a zero after rotations by right angles


class Hinge(NamedTuple):
    """A hinge and the pose of its link on the parent link, at angle 0."""

    parent: int  # link, or BASE
    rotation: np.ndarray  # (3, 3) from the link's frame to the parent's
    position: np.ndarray  # (3,) m, of the anchor, in the parent's frame
    axis: np.ndarray  # (3,) unit vector
    zero_rad: float  # qpos at angle 0
    stiffness: float  # N m/rad
    relaxed_rad: float  # qpos at which its spring is relaxed
    damping: float  # N m s/rad, beyond the joint law's
    joint: int  # of the model
    dof: int  # of the model; its index in qpos is one higher, since the base has 7 positions and 6 velocities


class Attachment(NamedTuple):
    """Pose of a frame that is fixed to a link."""

    link: int  # or BASE
    rotation: np.ndarray  # (3, 3) to the link's frame
    position: np.ndarray  # (3,) m


class Tree(NamedTuple):
    """The robot's hinges and bodies, as the generator uses them."""

    hinges: tuple[Hinge, ...]  # parents first; number i is coordinate 6 + i, after the base's
    bodies: dict[int, Attachment]  # by the body's id; the world and bodies fixed to it are not included

    @property
    def dofs(self) -> list[int]:
        """The model's degree of freedom of each coordinate."""
        return [*range(BASE_DOFS), *(hinge.dof for hinge in self.hinges)]

    def limb(self, links: Sequence[int]) -> "Tree":
        """The base with these links alone, which include the parents of each."""
        local = {BASE: BASE} | {link: k for k, link in enumerate(links)}
        return Tree(
            tuple(self.hinges[link]._replace(parent=local[self.hinges[link].parent]) for link in links),
            {
                body: attachment._replace(link=local[attachment.link])
                for body, attachment in self.bodies.items()
                if attachment.link in local
            },
        )

    def chain(self, link: int) -> list[int]:
        """The links from the base to this one, without the base."""
        links = []
        while link != BASE:
            links.append(link)
            link = self.hinges[link].parent
        return links[::-1]


def rotation(quaternion: np.ndarray) -> np.ndarray:
    """The rotation matrix of a unit quaternion, (3, 3)."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    matrix[np.abs(matrix) < ROUNDING] = 0.0
    return matrix.reshape(3, 3)


def read_tree(model: mujoco.MjModel) -> Tree:
    """The tree of a model for which `refusals` is empty."""
    base = int(model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE][0])
    bodies = {base: Attachment(BASE, np.eye(3), np.zeros(3))}
    hinges: list[Hinge] = []
    for body in range(1, model.nbody):
        if body == base or model.body_rootid[body] != base:
            continue
        parent = bodies[int(model.body_parentid[body])]
        link = parent.link
        turn = parent.rotation @ rotation(model.body_quat[body])
        position = parent.position + parent.rotation @ model.body_pos[body]  # of the body's origin
        for k in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            anchor, dof, qpos_index = model.jnt_pos[k], model.jnt_dofadr[k], model.jnt_qposadr[k]
            hinges.append(
                Hinge(
                    parent=link,
                    rotation=turn,
                    position=position + turn @ anchor,
                    axis=np.where(np.abs(model.jnt_axis[k]) < ROUNDING, 0.0, model.jnt_axis[k]),
                    zero_rad=float(model.qpos0[qpos_index]),
                    stiffness=float(model.jnt_stiffness[k]),
                    relaxed_rad=float(model.qpos_spring[qpos_index]),
                    damping=float(model.dof_damping[dof]),
                    joint=k,
                    dof=int(dof),
                )
            )
            link, turn, position = len(hinges) - 1, np.eye(3), -anchor
        bodies[body] = Attachment(link, turn, position)
    return Tree(tuple(hinges), bodies)


def refusals(model: mujoco.MjModel) -> Iterator[str]:
    """Unsupported features of a model, one line each; contacts are checked in `geom_pairs.py`."""
    option = model.opt
    is_free, is_hinge = (model.jnt_type == kind for kind in (mujoco.mjtJoint.mjJNT_FREE, HINGE))
    free = np.flatnonzero(is_free)
    if len(free) != 1:
        yield f"{len(free)} free joints"
    else:
        is_off_robot = model.body_rootid[model.jnt_bodyid] != model.jnt_bodyid[free[0]]
        for joint in np.flatnonzero(is_hinge & is_off_robot):
            yield f"joint '{model.joint(joint).name}', which is not on the robot"
    for joint in np.flatnonzero(~is_free & ~is_hinge):
        yield f"joint '{model.joint(joint).name}', which is no hinge"
    for feature, present in (
        ("a margin before joint limits", model.jnt_margin[model.jnt_limited > 0].any()),
        ("joint friction as a constraint", model.dof_frictionloss.any()),
        ("damping that is not linear", model.dof_dampingpoly.any()),
        ("springs that are not linear", model.jnt_stiffnesspoly.any()),
        ("gravity compensation", model.body_gravcomp.any()),
        ("equality constraints", model.neq),
        ("tendons", model.ntendon),
        ("actuators", model.nu),
        ("flexible bodies", model.nflex),
        ("a surrounding fluid", option.density or option.viscosity or option.wind.any()),
        ("an impratio other than 1 of a pyramidal cone", option.cone == PYRAMIDAL and option.impratio != 1.0),
        ("an integrator other than Euler", option.integrator != mujoco.mjtIntegrator.mjINT_EULER),
        ("a solver other than Newton's", option.solver != mujoco.mjtSolver.mjSOL_NEWTON),
        (f"more than {MAX_ITERATIONS} iterations of the solver", option.iterations > MAX_ITERATIONS),
        ("iterations against slipping", option.noslip_iterations),
        ("an option that is switched on", option.enableflags),
        ("an option that is switched off", option.disableflags != mujoco.mjtDisableBit.mjDSBL_EULERDAMP),
    ):
        if present:
            yield feature

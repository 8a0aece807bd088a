"""Mass matrix and bias forces of a tree of hinges on a free base, in the links' own frames.

The base's six coordinates are the acceleration of its origin along its own axes, and its angular acceleration
along the same: MuJoCo's, turned from the world into the base. RBDA: Featherstone, Rigid Body Dynamics
Algorithms (2008). Craig: Introduction to Robotics (2005), chapter 6.
"""

from typing import NamedTuple

import numpy as np

from footfall.envs.physics.generated.algebra import Matrix, Symmetric, Vector, cross, mirrored
from footfall.envs.physics.generated.expression import Scalar
from footfall.envs.physics.generated.tree import BASE, BASE_DOFS, Tree


class Inertia(NamedTuple):
    """The inertia of a rigid body in some frame (RBDA, equation 2.63)."""

    mass: Scalar  # kg
    moment: Vector  # (3,) kg m, mass times the centre of mass
    matrix: Matrix  # (3, 3) kg m^2, about the frame's origin

    def __add__(self, other: "Inertia") -> "Inertia":  # type: ignore[override]
        return Inertia(self.mass + other.mass, self.moment + other.moment, self.matrix + other.matrix)

    def part(self, share: float) -> "Inertia":
        """A share of the inertia."""
        return Inertia(self.mass * share, self.moment * share, self.matrix * share)

    def seen_from(self, rotation: Matrix, position: Vector) -> "Inertia":
        """The inertia in another frame, in which this frame has these axes and origin (RBDA, (2.66))."""
        moment = rotation @ self.moment
        shift = 2.0 * (position @ moment) + self.mass * (position @ position)
        outer = np.outer(position, moment)
        outer = outer + outer.T + self.mass * np.outer(position, position)
        turned = rotation @ self.matrix @ rotation.T
        matrix = mirrored(turned + np.eye(3) * shift - outer)
        return Inertia(self.mass, moment + self.mass * position, matrix)


NO_INERTIA = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))


def body_inertia(mass: Scalar, centre: Vector, axes: np.ndarray, principal: Vector) -> Inertia:
    """Inertia of a body in its own frame.

    Args:
        mass: kg.
        centre: (3,) m, of mass.
        axes: (3, 3) from the principal axes to the body's frame.
        principal: (3,) kg m^2, about the centre of mass.
    """
    about_centre = Inertia(mass, np.zeros(3), mirrored(axes * principal @ axes.T))
    return about_centre.seen_from(np.eye(3), centre)


class Dynamics(NamedTuple):
    """Result of `dynamics`. Forces are in the coordinates that the module's docstring defines."""

    mass: Symmetric  # without the hinges' armature
    bias: list[Scalar]  # force that keeps the coordinates' accelerations at 0


class _Wrench(NamedTuple):
    force: Vector
    torque: Vector  # about the frame's origin

    def seen_from(self, rotation: Matrix, position: Vector) -> "_Wrench":
        force = rotation @ self.force
        return _Wrench(force, rotation @ self.torque + cross(position, force))


def dynamics(
    tree: Tree,
    turns: list[Matrix],
    inertias: dict[int, Inertia],
    angular_velocity: Vector,
    speeds: list[Scalar],
    gravity: Vector,
) -> Dynamics:
    """The mass matrix by composite inertias and the bias forces by the recursive Newton-Euler algorithm.

    Both traverse the tree limb by limb (RBDA, tables 6.2 and 5.1; Craig, 6.45 to 6.53), so that few
    intermediate values are live.

    Args:
        tree: the robot.
        turns: (3, 3) each, from a link's frame to its parent's.
        inertias: inertias of each link that carries mass, and of the base, in the link's frame.
        angular_velocity: (3,) rad/s, of the base in its own frame.
        speeds: rad/s, of the hinges.
        gravity: (3,) m/s^2, in the base's frame.
    """
    children: dict[int, list[int]] = {}
    for link, hinge in enumerate(tree.hinges):
        children.setdefault(hinge.parent, []).append(link)
    mass: Symmetric = {}
    bias: list[Scalar] = [0.0] * (BASE_DOFS + len(tree.hinges))

    def visit(link: int, omega: Vector, alpha: Vector, acceleration: Vector) -> tuple[Inertia, _Wrench]:
        """Composite inertia of a link and its descendants, and the wrench that moves them.

        The arguments hold for a motion in which no coordinate accelerates, in the link's frame.

        Args:
            link: index, or BASE.
            omega: angular velocity.
            alpha: angular acceleration.
            acceleration: of the link's origin.
        """
        composite = inertias.get(link, NO_INERTIA)
        m, h, inertia = composite
        force = m * acceleration + cross(alpha, h) + cross(omega, cross(omega, h))
        torque = inertia @ alpha + cross(omega, inertia @ omega) + cross(h, acceleration)
        for child in children.get(link, []):
            hinge, turn = tree.hinges[child], turns[child]
            hinge_velocity = hinge.axis * speeds[child]
            omega_in_child = turn.T @ omega
            anchor_acceleration = (
                acceleration + cross(alpha, hinge.position) + cross(omega, cross(omega, hinge.position))
            )
            of_child, wrench = visit(
                child,
                omega_in_child + hinge_velocity,
                turn.T @ alpha + cross(omega_in_child, hinge_velocity),
                turn.T @ anchor_acceleration,
            )
            bias[BASE_DOFS + child] = hinge.axis @ wrench.torque
            wrench = wrench.seen_from(turn, hinge.position)
            force, torque = force + wrench.force, torque + wrench.torque
            _mass_of_hinge(child, of_child)
            composite = composite + of_child.seen_from(turn, hinge.position)
        return composite, _Wrench(force, torque)

    def _mass_of_hinge(link: int, composite: Inertia) -> None:
        """Fill a hinge's row of the mass matrix: forces on itself, its ancestors and the base."""
        row, axis = BASE_DOFS + link, tree.hinges[link].axis
        wrench = _Wrench(cross(axis, composite.moment), composite.matrix @ axis)
        mass[row, row] = axis @ wrench.torque
        while True:
            wrench = wrench.seen_from(turns[link], tree.hinges[link].position)
            link = tree.hinges[link].parent
            if link == BASE:
                break
            mass[row, BASE_DOFS + link] = tree.hinges[link].axis @ wrench.torque
        for k in range(3):
            mass[row, k], mass[row, 3 + k] = wrench.force[k], wrench.torque[k]

    composite, wrench = visit(BASE, angular_velocity, np.zeros(3), -gravity)
    bias[:3], bias[3:BASE_DOFS] = wrench.force, wrench.torque
    x, y, z = composite.moment
    moment = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]  # torque of an acceleration (RBDA, equation 2.63)
    for i in range(3):
        mass[i, i] = composite.mass
        for j in range(3):
            mass[3 + i, j] = moment[i][j]
        for j in range(i + 1):
            mass[3 + i, 3 + j] = composite.matrix[i, j]
    return Dynamics(mass, bias)

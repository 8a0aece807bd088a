"""Critic terms: privileged observations of the critic, which no robot senses.

The critic always reads the actor's observation as well, its newest values without delay, bias and noise, and
every randomised quantity of this robot.
"""

from collections.abc import Callable
from typing import Annotated, NamedTuple

import jax

from footfall.common.terms import Between
from footfall.envs.terms.data import StepData
from footfall.robots import kinds
from footfall.robots.kinds import Kind


class CriticTerm(NamedTuple):
    """The declaration of a critic term."""

    kind: Kind  # how many numbers, and their mirror image
    source: Callable[..., jax.Array]  # from `StepData`, in which feet and torques are zero at a reset


def critic_term(kind: Kind) -> Callable[[Callable[..., jax.Array]], CriticTerm]:
    """Decorator of a function of `StepData` that returns numbers of this kind."""
    return lambda source: CriticTerm(kind, source)


@critic_term(kinds.VECTOR)
def linear_velocity(data: StepData) -> jax.Array:
    """Velocity of the base in the body frame, m/s."""
    return data.linear_velocity


@critic_term(kinds.SCALAR)
def height(data: StepData) -> jax.Array:
    """Height of the base above the ground, m."""
    return data.height


@critic_term(kinds.FOOT_AMOUNTS)
def contact(data: StepData) -> jax.Array:
    """1 for each foot in contact, else 0."""
    return data.contact


@critic_term(kinds.FOOT_AMOUNTS)
def clearance(data: StepData) -> jax.Array:
    """Height of each foot above the ground, dm."""
    return data.clearance * 10.0


@critic_term(kinds.JOINTS)
def torque(data: StepData) -> jax.Array:
    """Torque of each motor as a share of its peak torque."""
    return data.torque / data.scene.peak_torque


@critic_term(kinds.FOOT_AMOUNTS)
def ground(data: StepData, *, ahead_m: Annotated[float, Between(-2.0, 2.0)] = 0.0) -> jax.Array:
    """Ground height at each foot, or ahead of it along the heading, minus the height below the base, dm."""
    points = data.scene.feet.centres(data.foot_position)[:, :2] + ahead_m * data.forward
    return 10.0 * (data.ground(points) - data.ground(data.base_position[:2]))


CRITIC: dict[str, CriticTerm] = {
    term.source.__name__: term for term in (linear_velocity, height, contact, clearance, torque, ground)
}

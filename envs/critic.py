"""What the critic sees beyond the actor: clean readings and what no robot senses."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from footfall.domain_rand.randomisation import QUANTITIES, Randomisation
from footfall.domain_rand.sample import Sample
from footfall.policies.contract import Contract
from footfall.policies.observation import term_kind
from footfall.robots import kinds
from footfall.robots.kinds import Kind


class Truth(NamedTuple):
    """What a simulation knows and a robot does not."""

    linear_velocity: jax.Array  # (3,) m/s, of the base, body frame
    height: jax.Array  # () m, base above ground
    contact: jax.Array  # (feet,) 1.0 in contact
    clearance: jax.Array  # (feet,) m above ground
    torque: jax.Array  # (n,) of the motors, as a share of their peak torque


class CriticTerm(NamedTuple):
    """The declaration of a term of the critic's observation."""

    kind: Kind  # how many numbers, and their mirror image
    source: Callable[[Truth], jax.Array]


TERMS: dict[str, CriticTerm] = {
    "linear_velocity": CriticTerm(kinds.VECTOR, lambda truth: truth.linear_velocity),
    "height": CriticTerm(kinds.SCALAR, lambda truth: truth.height),
    "contact": CriticTerm(kinds.FOOT_AMOUNTS, lambda truth: truth.contact),
    "clearance": CriticTerm(kinds.FOOT_AMOUNTS, lambda truth: truth.clearance * 10.0),
    "torque": CriticTerm(kinds.JOINTS, lambda truth: truth.torque),
}


def critic_observation(observed: jax.Array, clean: jax.Array, truth: Truth, sample: Sample) -> jax.Array:
    """The critic's observation, laid out as `critic_kinds` says.

    Args:
        observed: the actor's observation.
        clean: a frame of it without delay, bias, noise and history.
        truth: for `TERMS`.
        sample: how this robot differs from the nominal one.
    """
    terms = [jnp.ravel(term.source(truth)) for term in TERMS.values()]
    sampled = [jnp.ravel(sample[name]) for name in QUANTITIES if name in sample]
    return jnp.concatenate([observed, clean, *terms, *sampled])


def critic_kinds(contract: Contract, randomisation: Randomisation) -> list[Kind]:
    """What lies end to end in the critic's observation."""
    frame = [term_kind(term.name) for term in contract.observation]
    terms = [term.kind for term in TERMS.values()]
    sampled = [q.kind for name, q in QUANTITIES.items() if getattr(randomisation, name) is not None]
    return [*actor_kinds(contract), *frame, *terms, *sampled]


def actor_kinds(contract: Contract) -> list[Kind]:
    """What lies end to end in the actor's observation."""
    return [term_kind(term.name) for term in contract.observation for _ in range(term.history)]

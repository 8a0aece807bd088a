"""The observation of learned policies, written once for NumPy (deployment) and JAX (training) arrays."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from footfall.common.arrays import library
from footfall.common.errors import UserError
from footfall.common.outside import find, is_import_path
from footfall.common.terms import bind
from footfall.policies.contract import Contract, Term
from footfall.policies.height_scan import HEIGHT_SCAN, HeightScan
from footfall.robots import kinds
from footfall.robots.kinds import Kind, Parts
from footfall.robots.readings import READINGS, Readings

Array = Any


class Inputs(NamedTuple):
    """Values from which an observation is computed."""

    readings: Readings
    last_action: Array  # (..., n)
    command: Array  # (..., 3): forward m/s, leftward m/s, yaw rad/s
    phase: Array  # (..., 1) gait clock, in cycles
    height_scan: Array | None = None  # (..., points) m above the base, NaN if unknown; None without a scan


def moving(command: Array, contract: Contract) -> Array:
    """1.0 if the command asks for motion, 0.0 for standing, shape (..., 1)."""
    norm = library(command).sqrt((command * command).sum(axis=-1, keepdims=True))
    return (norm >= contract.standing_command).astype(command.dtype)


class ObservationTerm(NamedTuple):
    """Declaration of an observation term. A configuration gives its scale, history and parameters."""

    # Number of values and their mirror image; a function if they depend on the term's parameters.
    kind: Kind | Callable[[Any], Kind]
    source: Callable[..., Array]  # function of `Inputs` and the contract, or a class of such functions


def observation_term(kind: Kind) -> Callable[[Callable[..., Array]], ObservationTerm]:
    """Decorator for a function of `Inputs` and the contract that returns values of this kind.

    The function must work for NumPy and JAX arrays: `xp = inputs.command.__array_namespace__()`.
    """
    return lambda source: ObservationTerm(kind, source)


def reading_term(name: str) -> ObservationTerm:
    """Observation term that is a reading, unchanged."""

    def source(inputs: Inputs, _: Contract) -> Array:
        return inputs.readings[name]

    source.__doc__ = f"The reading `{name}`."
    return ObservationTerm(READINGS[name].kind, source)


@observation_term(kinds.CLOCK)
def clock(inputs: Inputs, contract: Contract) -> Array:
    """Sine and cosine of the gait clock; zeros during a command to stand."""
    xp = library(inputs.phase)
    angle = 2 * xp.pi * inputs.phase
    walk = moving(inputs.command, contract)
    return xp.concat([xp.sin(angle) * walk, xp.cos(angle) * walk], axis=-1)


@observation_term(kinds.JOINTS)
def joint_position(inputs: Inputs, contract: Contract) -> Array:
    """Joint positions minus the default pose, rad."""
    position = inputs.readings["joint_position"]
    return position - library(position).asarray(contract.default_pose_rad, dtype=position.dtype)


@observation_term(kinds.COMMAND)
def command(inputs: Inputs, contract: Contract) -> Array:
    """The command: forward m/s, leftward m/s, yaw rad/s."""
    return inputs.command


@observation_term(kinds.JOINTS)
def last_action(inputs: Inputs, contract: Contract) -> Array:
    """The policy's last action."""
    return inputs.last_action


TERMS: dict[str, ObservationTerm] = {name: reading_term(name) for name in READINGS} | {
    "joint_position": joint_position,
    "command": command,
    "last_action": last_action,
    "clock": clock,
    HEIGHT_SCAN: ObservationTerm(lambda scan: scan.kind, HeightScan),
}


def find_term(name: str) -> ObservationTerm:
    """Observation term by name or MODULE:NAME; raises UserError if there is none."""
    if name in TERMS:
        return TERMS[name]
    if not is_import_path(name):
        raise UserError(f"no observation term '{name}': there are {', '.join(TERMS)}, or MODULE:NAME")
    term = find(name, "observation term")
    if not isinstance(term, ObservationTerm):
        raise UserError(f"{name} is not an observation term: expected a function under @observation_term")
    return term


def term_kind(term: Term) -> Kind:
    """Kind of a term with its parameters; raises UserError as `term_source`."""
    kind = find_term(term.name).kind
    return kind if isinstance(kind, Kind) else kind(term_source(term))


def term_source(term: Term, where: str = "contract.observation") -> Callable[..., Array]:
    """Function of a term, with its parameters set.

    Raises:
        UserError: there is no such term, or its parameters are wrong; the message begins with `where`.
    """
    source = find_term(term.name).source
    return bind(source, term.settings, where) if term.settings or isinstance(source, type) else source


def term_sources(contract: Contract) -> tuple[Callable[..., Array], ...]:
    """Functions of all terms of a contract; raises UserError as `term_source`."""
    return tuple(map(term_source, contract.observation))


def term_size(term: Term, contract: Contract) -> int:
    """Number of values of a term, without history."""
    return term_kind(term).size(Parts(len(contract.joints)))


def size_per_step(contract: Contract) -> int:
    """Number of values of all terms, without history."""
    return sum(term_size(term, contract) for term in contract.observation)


def observation_size(contract: Contract) -> int:
    """Number of values of an observation, including the history."""
    return sum(term_size(term, contract) * term.history for term in contract.observation)


def history_length(contract: Contract) -> int:
    """Longest history of a term."""
    return max(term.history for term in contract.observation)


def step_values(
    inputs: Inputs, contract: Contract, sources: Sequence[Callable[..., Array]] | None = None
) -> Array:
    """Scaled values of all terms at one step, shape (..., size_per_step).

    Args:
        inputs: sources of the values.
        contract: contract of the policy.
        sources: `term_sources` of the contract, if already known: finding a term takes time.
    """
    xp = library(inputs.command)
    pairs = zip(contract.observation, sources or term_sources(contract), strict=True)
    return xp.concat([source(inputs, contract) * term.scale for term, source in pairs], axis=-1)


def push_history(history: Array, newest: Array) -> Array:
    """Append the newest values to the history, and drop the oldest. Shapes (..., history, size_per_step)."""
    return library(history).concat([history[..., 1:, :], newest[..., None, :]], axis=-2)


def observation(history: Array, contract: Contract) -> Array:
    """Input of the actor from the history, shape (..., observation_size).

    Terms are in the order of the contract; within a term the oldest values come first.
    """
    xp = history.__array_namespace__()
    parts, start = [], 0
    for term in contract.observation:
        stop = start + term_size(term, contract)
        values = history[..., history.shape[-2] - term.history :, start:stop]
        parts.append(values.reshape((*history.shape[:-2], -1)))
        start = stop
    return xp.concat(parts, axis=-1)

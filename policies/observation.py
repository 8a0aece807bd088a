"""The observation of learned policies, written once for NumPy (deployment) and JAX (training) arrays."""

from collections.abc import Callable
from typing import Any, NamedTuple

from footfall.common.errors import UserError
from footfall.policies.contract import Contract
from footfall.robots import kinds
from footfall.robots.kinds import Kind, Parts
from footfall.robots.readings import READINGS, Readings

Array = Any


class Inputs(NamedTuple):
    """Everything an observation frame is made of."""

    readings: Readings
    last_action: Array  # (..., n)
    command: Array  # (..., 3): forward m/s, leftward m/s, yaw rad/s
    phase: Array  # (..., 1) of the gait clock, in cycles


def moving(command: Array, contract: Contract) -> Array:
    """1.0 where the command asks to move, 0.0 where it asks to stand, shape (..., 1)."""
    xp = command.__array_namespace__()
    norm = xp.sqrt(xp.sum(command * command, axis=-1, keepdims=True))
    return xp.astype(norm >= contract.standing_command, command.dtype)


def _clock(inputs: Inputs, contract: Contract) -> Array:
    xp = inputs.phase.__array_namespace__()
    angle = 2 * xp.pi * inputs.phase
    walk = moving(inputs.command, contract)
    return xp.concat([xp.sin(angle) * walk, xp.cos(angle) * walk], axis=-1)


def _position_error(inputs: Inputs, contract: Contract) -> Array:
    position = inputs.readings["joint_position"]
    xp = position.__array_namespace__()
    return position - xp.asarray(contract.default_pose_rad, dtype=position.dtype)


class ObservationTerm(NamedTuple):
    """The declaration of an observation term. A configuration gives its scale and history."""

    kind: Kind  # how many numbers in one frame, and their mirror image
    source: Callable[[Inputs, Contract], Array]


def reading_term(name: str) -> ObservationTerm:
    """The term that shows a reading as it is."""
    return ObservationTerm(READINGS[name].kind, lambda inputs, _: inputs.readings[name])


TERMS: dict[str, ObservationTerm] = {name: reading_term(name) for name in READINGS} | {
    "joint_position": ObservationTerm(kinds.JOINTS, _position_error),
    "command": ObservationTerm(kinds.COMMAND, lambda inputs, _: inputs.command),
    "last_action": ObservationTerm(kinds.JOINTS, lambda inputs, _: inputs.last_action),
    "clock": ObservationTerm(kinds.CLOCK, _clock),
}


def term_kind(name: str) -> Kind:
    """Raises UserError if there is no such term."""
    if name not in TERMS:
        raise UserError(f"no observation term '{name}': there are {', '.join(TERMS)}")
    return TERMS[name].kind


def term_size(name: str, contract: Contract) -> int:
    """Numbers in one frame of a term."""
    return term_kind(name).size(Parts(len(contract.joints)))


def frame_size(contract: Contract) -> int:
    """Numbers in one observation frame (all terms, no history)."""
    return sum(term_size(term.name, contract) for term in contract.observation)


def observation_size(contract: Contract) -> int:
    """Numbers in an observation, history included."""
    return sum(term_size(term.name, contract) * term.history for term in contract.observation)


def history_length(contract: Contract) -> int:
    """Frames that must be kept."""
    return max(term.history for term in contract.observation)


def frame(inputs: Inputs, contract: Contract) -> Array:
    """One scaled observation frame, shape (..., frame_size)."""
    xp = inputs.command.__array_namespace__()
    parts = [TERMS[term.name].source(inputs, contract) * term.scale for term in contract.observation]
    return xp.concat(parts, axis=-1)


def push_frame(frames: Array, newest: Array) -> Array:
    """Drop the oldest of the kept frames, append the newest. Shapes (..., history, frame_size)."""
    xp = frames.__array_namespace__()
    return xp.concat([frames[..., 1:, :], newest[..., None, :]], axis=-2)


def observation(frames: Array, contract: Contract) -> Array:
    """The actor's input from the kept frames, shape (..., observation_size).

    Term by term in contract order; within a term the oldest frame comes first.
    """
    xp = frames.__array_namespace__()
    parts, start = [], 0
    for term in contract.observation:
        stop = start + term_size(term.name, contract)
        kept = frames[..., frames.shape[-2] - term.history :, start:stop]
        parts.append(kept.reshape((*frames.shape[:-2], -1)))
        start = stop
    return xp.concat(parts, axis=-1)

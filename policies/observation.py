"""The observation of learned policies, written once for NumPy (deployment) and JAX (training) arrays."""

from collections.abc import Callable
from typing import Any, NamedTuple

from footfall.common.errors import UserError
from footfall.policies.contract import Contract
from footfall.robots.readings import Readings

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
    position = inputs.readings.joint_position
    xp = position.__array_namespace__()
    return position - xp.asarray(contract.default_pose_rad, dtype=position.dtype)


TERMS: dict[str, Callable[[Inputs, Contract], Array]] = {
    "gyro": lambda inputs, _: inputs.readings.gyro,
    "gravity": lambda inputs, _: inputs.readings.gravity,
    "command": lambda inputs, _: inputs.command,
    "joint_position": _position_error,
    "joint_velocity": lambda inputs, _: inputs.readings.joint_velocity,
    "last_action": lambda inputs, _: inputs.last_action,
    "clock": _clock,
}


def term_size(name: str, contract: Contract) -> int:
    """Numbers in one frame of a term."""
    if name not in TERMS:
        raise UserError(f"no observation term '{name}': there are {', '.join(TERMS)}")
    sizes = {"gyro": 3, "gravity": 3, "command": 3, "clock": 2}
    return sizes.get(name, len(contract.joints))


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
    parts = [TERMS[term.name](inputs, contract) * term.scale for term in contract.observation]
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

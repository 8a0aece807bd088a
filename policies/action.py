"""Joint position targets from a policy's action, written once for NumPy and JAX arrays."""

from typing import Any

from footfall.common.arrays import library
from footfall.policies.contract import Contract
from footfall.policies.gaits import planned_lift
from footfall.policies.observation import moving

Array = Any


def gait_reference(phase: Array, command: Array, contract: Contract) -> Array:
    """Reference offset of each joint from the default pose, rad, shape (..., n); zero without a reference
    motion.

    Args:
        phase: gait clock in cycles, shape (..., 1).
        command: velocity command, shape (..., 3).
        contract: contract with the gait.
    """
    xp = library(phase)
    if contract.gait is None or not any(contract.gait.amplitude_rad):
        return xp.zeros((*phase.shape[:-1], len(contract.joints)), dtype=phase.dtype)
    offsets = xp.asarray(contract.gait.phase, dtype=phase.dtype)
    amplitude = xp.asarray(contract.gait.amplitude_rad, dtype=phase.dtype)
    lift = planned_lift(phase, offsets, contract.gait.duty)
    return amplitude * lift * moving(command, contract)


def joint_target(action: Array, phase: Array, command: Array, contract: Contract) -> Array:
    """Position targets for an action, rad, shape (..., n): default pose + reference + scaled action."""
    xp = library(action)
    default = xp.asarray(contract.default_pose_rad, dtype=action.dtype)
    scale = xp.asarray(contract.action_scale_rad, dtype=action.dtype)
    return default + gait_reference(phase, command, contract) + scale * action

"""Machine, packages and policies with which figures were measured."""

import platform
from collections.abc import Sequence

from footfall.common.processors import usable_cores
from footfall.policies.policy import Policy

PACKAGES = ("footfall", "mujoco", "numpy", "onnxruntime", "daqp")


def machine() -> str:
    """This machine in a few words."""
    return f"{platform.system()} {platform.machine()}, {usable_cores()} cores"


def policy_description(policy: Policy, changes: Sequence[str] = ()) -> str:
    """Description of a policy, one sentence: its trainer if the file names it, its motion prior if any.

    Args:
        policy: the policy.
        changes: changed settings of a controller, from `footfall.policies.registry.changed_settings`.
    """
    contract = policy.contract
    if contract is None:
        changed = f", with {', '.join(changes)}" if changes else ""
        return f"hand-written controller, {policy.rate_hz:g} Hz" + _estimate_note(policy) + changed
    trainer = getattr(policy, "trainer", None)
    text = f"learned policy{f' (trained by {trainer})' if trainer else ''}, {policy.rate_hz:g} Hz"
    gait = contract.gait
    if gait is not None and any(gait.amplitude_rad):
        return text + f", actions added to a reference gait of {gait.frequency_hz:g} Hz (a motion prior)"
    if gait is not None:
        return text + f", no motion prior, gait clock of {gait.frequency_hz:g} Hz"
    return text + ", no motion prior"


def _estimate_note(policy: Policy) -> str:
    return ", on estimated velocity" if policy.needs_estimate else ""

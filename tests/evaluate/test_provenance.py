"""Origin of a policy in a report."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from footfall.evaluate.provenance import origin
from footfall.policies.contract import Contract
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot


def learned(contract: Contract) -> Any:
    return SimpleNamespace(contract=contract, rate_hz=contract.control_rate_hz, needs_estimate=False)


def test_a_reference_gait_is_named_as_a_prior(contract: Contract) -> None:
    assert contract.gait is not None
    assert any(contract.gait.amplitude_rad)
    assert "2.2 Hz (a motion prior)" in origin(learned(contract))
    assert "no motion prior" in origin(learned(replace(contract, gait=None)))


def test_a_learned_policy_names_its_trainer(contract: Contract) -> None:
    policy = learned(replace(contract, gait=None))
    policy.trainer = "rsl_rl"
    assert origin(policy) == "learned policy (trained by rsl_rl), 50 Hz, no motion prior"


def test_hand_written_controllers_declare_whether_they_need_an_estimate(go1: Robot) -> None:
    assert origin(load_policy("stand", go1)) == "hand-written controller, 500 Hz"
    assert "on estimated velocity" in origin(load_policy("mpc", go1))

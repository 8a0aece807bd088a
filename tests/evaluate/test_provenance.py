"""Origin of a policy in a report."""

import platform
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from footfall.common.versions import versions
from footfall.evaluate.provenance import PACKAGES, machine, origin
from footfall.policies.contract import Contract, Gait
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot


def learned(contract: Contract) -> Any:
    return SimpleNamespace(contract=contract, rate_hz=contract.control_rate_hz, needs_estimate=False)


def test_a_reference_gait_is_named_as_a_prior(contract: Contract) -> None:
    assert contract.gait is not None
    assert any(contract.gait.amplitude_rad)
    assert "reference gait of 2.2 Hz (a motion prior)" in origin(learned(contract))


def test_a_clock_alone_is_no_prior(contract: Contract) -> None:
    clock = Gait(2.5, contract.gait.phase if contract.gait else (), (0.0,) * 12)
    assert "no motion prior, gait clock of 2.5 Hz" in origin(learned(replace(contract, gait=clock)))
    assert origin(learned(replace(contract, gait=None))) == "learned policy, 50 Hz, no motion prior"


def test_a_learned_policy_names_its_trainer(contract: Contract) -> None:
    policy = learned(replace(contract, gait=None))
    policy.trainer = "rsl_rl"
    assert origin(policy) == "learned policy (trained by rsl_rl), 50 Hz, no motion prior"


def test_hand_written_controllers_declare_whether_they_need_an_estimate(go1: Robot) -> None:
    assert origin(load_policy("stand", go1)) == "hand-written controller, 500 Hz"
    assert "on estimated velocity" in origin(load_policy("mpc", go1))


def test_a_gait_of_some_joints_is_a_prior_too(contract: Contract) -> None:
    assert contract.gait is not None
    one = replace(contract.gait, amplitude_rad=(0.0,) * 11 + (0.1,))
    assert "(a motion prior)" in origin(learned(replace(contract, gait=one)))


def test_a_machine_is_named_by_its_usable_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("footfall.evaluate.provenance.usable_cores", lambda: 7)
    assert machine() == f"{platform.system()} {platform.machine()}, 7 cores"


def test_versions_include_all_that_results_depend_on() -> None:
    """The solver and the network's runtime among them: other ones give other decisions."""
    assert set(PACKAGES) == {"footfall", "mujoco", "numpy", "onnxruntime", "daqp"}
    assert {"python", *PACKAGES} <= set(versions(PACKAGES))

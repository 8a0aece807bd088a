"""A learned policy from readings to joint targets, with a network that depends on every input."""

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_policy import write_network

from footfall import PolicyInput, Robot, UserError
from footfall.policies.contract import CONTRACT_KEY, Contract
from footfall.policies.learned import LearnedPolicy
from footfall.policies.policy import Sensed
from footfall.policies.registry import ZOO

onnx = pytest.importorskip("onnx")
SIZE = 6 + 3 + 3 + 36 + 36 + 24 + 2  # of the observation
Make = Callable[..., LearnedPolicy]
Sizes = Sequence[tuple[str, int]]


@pytest.fixture
def make(tmp_path: Path, contract: Contract, go1: Robot) -> Make:
    """Makes a policy of one layer with random weights of a scale."""

    def policy(scale: float, contract: Contract = contract) -> LearnedPolicy:
        weights = scale * np.random.default_rng(0).standard_normal((SIZE, 12)).astype(np.float32)
        return LearnedPolicy(write_network(onnx, tmp_path / "p.onnx", weights, contract), go1)

    return policy


@pytest.fixture
def policy(make: Make) -> LearnedPolicy:
    return make(0.1)


def observations(seed: int) -> list[PolicyInput]:
    rng, upright = np.random.default_rng(seed), np.array([1.0, 0.0, 0.0, 0.0])
    command = np.array([0.5, 0.1, -0.2])
    sensed = [Sensed(*rng.normal(size=(2, 3)), upright, *rng.normal(size=(3, 12))) for _ in range(9)]
    return [PolicyInput(step / 50, each, command, np.zeros(3), 0.28) for step, each in enumerate(sensed)]


def episode(policy: LearnedPolicy, seed: int = 1) -> np.ndarray:
    seen = observations(seed)
    policy.reset(seen[0])
    return np.array([policy.act(each) for each in seen])


def test_a_second_episode_is_the_first_to_the_bit(policy: LearnedPolicy) -> None:
    """Clock, last action and history start again."""
    first = episode(policy)
    episode(policy, seed=2)
    np.testing.assert_array_equal(episode(policy), first)


def test_history_and_last_action_are_observed(policy: LearnedPolicy, contract: Contract) -> None:
    """As in training, missing earlier readings are copies of the first reading."""
    first, second, *_ = observations(1)
    policy.reset(first)
    policy.act(first)
    gyro = contract.observation[0].scale * first.sensed.gyro
    np.testing.assert_allclose(policy.observed[:6], [*gyro, *gyro], rtol=1e-6)
    taken = policy.action.copy()
    policy.act(second)
    np.testing.assert_allclose(policy.observed[-2 - 12 : -2], taken, rtol=1e-6)


def test_the_command_is_a_target_under_the_contracts_gains(policy: LearnedPolicy, contract: Contract) -> None:
    """With no reference gait, the target is the default pose and the scaled action."""
    seen = observations(1)[0]._replace(command=np.zeros(3))
    policy.reset(seen)
    command = policy.act(seen)
    expected = np.array(contract.default_pose_rad) + np.array(contract.action_scale_rad) * policy.action
    assert command.position.dtype == np.float64
    np.testing.assert_allclose(command.position, expected, rtol=1e-12)
    np.testing.assert_array_equal([command.kp, command.kd], [contract.kp, contract.kd])
    np.testing.assert_array_equal([command.velocity, command.torque], 0.0)


def test_the_action_is_the_networks_output(make: Make) -> None:
    """Actions of any size are passed on: the joint layer limits the targets."""
    policy, weights = make(1.0), np.random.default_rng(0).standard_normal((SIZE, 12)).astype(np.float32)
    episode(policy)
    np.testing.assert_allclose(policy.action, policy.observed @ weights, rtol=1e-4)
    assert np.abs(policy.action).max() > 2.0


def test_a_policy_runs_at_its_contracts_rate(make: Make, contract: Contract) -> None:
    """The policy's clock has the contract's rate, too.

    2.2 Hz at 40 steps per second are 0.055 cycles per step.
    """
    policy, seen = make(0.0, replace(contract, control_rate_hz=40.0)), observations(1)[0]
    assert (policy.rate_hz, policy.needs_estimate, policy.notes) == (40.0, False, ())
    policy.reset(seen)
    for _ in range(2):
        policy.act(seen)
    angle = 2 * np.pi * 0.055
    np.testing.assert_allclose(policy.observed[-2:], [np.sin(angle), np.cos(angle)], atol=1e-6)


def write_graph(
    path: Path, contract: Contract, inputs: Sizes, outputs: Sizes, kinds: tuple[str, str] = ("FLOAT", "FLOAT")
) -> Path:
    """A network that returns zeros; inputs and outputs are names and sizes."""
    helper, types = onnx.helper, onnx.TensorProto
    (first, size), number = inputs[0], np.float64 if kinds[0] == "DOUBLE" else np.float32
    nodes, weights = [], []
    for name, count in outputs:
        nodes.append(helper.make_node("MatMul", [first, f"to_{name}"], [f"raw_{name}"]))
        nodes.append(helper.make_node("Cast", [f"raw_{name}"], [name], to=getattr(types, kinds[1])))
        weights.append(onnx.numpy_helper.from_array(np.zeros((size, count), number), f"to_{name}"))
    declared = [
        [helper.make_tensor_value_info(name, getattr(types, kind), ["batch", count]) for name, count in each]
        for each, kind in zip((inputs, outputs), kinds, strict=True)
    ]
    graph = helper.make_graph(nodes, "zeros", *declared, weights)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    helper.set_model_props(model, {CONTRACT_KEY: contract.to_json()})
    onnx.save(model, path)
    return path


def test_a_policy_has_its_files_or_a_given_name(tmp_path: Path, contract: Contract, go1: Robot) -> None:
    """The names of its input and output may be any."""
    path = write_graph(tmp_path / "gentle.v2.onnx", contract, [("x", SIZE)], [("y", 12)])
    policy = LearnedPolicy(path, go1)
    assert (policy.name, policy.trainer) == ("gentle.v2", None)
    assert LearnedPolicy(path, go1, "mine").name == "mine"
    assert not episode(policy)[:, 4].any()


def test_other_files_are_refused_in_one_line(tmp_path: Path, contract: Contract, go1: Robot) -> None:
    def refusal(path: Path, found: str = "") -> None:
        with pytest.raises(UserError, match=rf"{path.name}[^\n]*{found}[^\n]*\Z"):
            LearnedPolicy(path, go1)

    refusal(tmp_path / "absent.onnx")
    (tmp_path / "text.onnx").write_text("a walk\nin the park")
    refusal(tmp_path / "text.onnx")
    refusal(write_network(onnx, tmp_path / "bare.onnx", np.zeros((3, 12), np.float32), None), "contract")
    one, two, single = ("x", SIZE), ("y", 12), ("FLOAT", "FLOAT")
    for inputs, outputs, kinds, found in (
        ([one, ("z", SIZE + 3)], [two], single, f"input .*{SIZE}"),
        ([("x", SIZE + 1)], [two], single, f"input .*{SIZE}"),
        ([one], [two, ("z", 12)], single, "output .*12"),
        ([one], [("y", 13)], single, "output .*12"),
        ([one], [two], ("DOUBLE", "DOUBLE"), "double"),
        ([one], [two], ("FLOAT", "DOUBLE"), "float64"),
    ):
        refusal(write_graph(tmp_path / "p.onnx", contract, inputs, outputs, kinds), found)
    weights = np.zeros((SIZE, 12), np.float32)
    for number in (np.nan, np.inf):
        weights[5, 7] = number
        refusal(write_network(onnx, tmp_path / "p.onnx", weights, contract), "NaN")


def test_a_policy_uses_one_core_and_prints_nothing(policy: LearnedPolicy) -> None:
    """A control loop has one core, and would miss deadlines beside busy threads."""
    options = policy._session.get_session_options()
    assert (options.intra_op_num_threads, options.inter_op_num_threads) == (1, 1)
    assert options.get_session_config_entry("session.intra_op.allow_spinning") == "0"
    assert options.log_severity_level == 4
    assert policy._session.get_providers() == ["CPUExecutionProvider"]


def test_a_policy_leaves_no_telemetry_in_the_users_home(tmp_path: Path) -> None:
    """ONNX Runtime's telemetry keeps an identifier and a database there."""
    silent = ("CI", "GITHUB_ACTIONS", "ORT_DISABLE_TELEMETRY", "XDG_CACHE_HOME")  # disable or move it
    environment = {name: value for name, value in os.environ.items() if name not in silent}
    program = "import sys; from pathlib import Path; from footfall.policies.learned import open_network; "
    program += "open_network(Path(sys.argv[1]))"
    command = [sys.executable, "-c", program, str(ZOO / "go1-flat" / "policy.onnx")]
    subprocess.run(command, env=environment | {"HOME": str(tmp_path)}, check=True)
    assert list(tmp_path.rglob("*")) == []

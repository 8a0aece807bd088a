"""Export: the actor as an ONNX file that carries its contract, checked against the trainer's own network."""

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import onnx
from brax.training.agents.ppo.networks import PPONetworks
from onnx import TensorProto, helper, numpy_helper

from policies.contract import CONTRACT_KEY, Contract
from policies.learned import open_network
from robots.errors import UserError
from robots.files import write_atomically

OPSET = 17
IR_VERSION = 8  # old enough for the ONNX Runtime of a robot's small computer
PARITY_LIMIT = 1e-5
RANDOM_OBSERVATIONS = 1000


def actor_mean(networks: PPONetworks, normalizer: Any, policy: Any, observed: Any) -> np.ndarray:
    """Deterministic actions of the trainer's own network, (k, observation) to (k, n)."""
    with jax.default_matmul_precision("highest"):
        mean, _ = networks.policy_network.apply(normalizer, policy, {"state": jnp.asarray(observed)})
    return np.asarray(mean)


def to_onnx(normalizer: Any, policy: Any, contract: Contract) -> onnx.ModelProto:
    """The normalised ELU network as an ONNX graph, its contract in the metadata."""
    initializers = [
        numpy_helper.from_array(np.asarray(normalizer.mean["state"], np.float32), "mean"),
        numpy_helper.from_array(np.asarray(normalizer.std["state"], np.float32), "std"),
    ]
    nodes = [
        helper.make_node("Sub", ["observation", "mean"], ["centred"]),
        helper.make_node("Div", ["centred", "std"], ["layer_0"]),
    ]
    layers = _dense_layers(policy)
    for index, (kernel, bias) in enumerate(layers):
        initializers += [
            numpy_helper.from_array(kernel, f"kernel_{index}"),
            numpy_helper.from_array(bias, f"bias_{index}"),
        ]
        last = index == len(layers) - 1
        output = "action" if last else f"dense_{index}"
        inputs = [f"layer_{index}", f"kernel_{index}", f"bias_{index}"]
        nodes.append(helper.make_node("Gemm", inputs, [output]))
        if not last:
            nodes.append(helper.make_node("Elu", [output], [f"layer_{index + 1}"]))
    size, actions = layers[0][0].shape[0], layers[-1][0].shape[1]
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["batch", size])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["batch", actions])],
        initializers,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)])
    model.ir_version = IR_VERSION
    helper.set_model_props(model, {CONTRACT_KEY: contract.to_json()})
    onnx.checker.check_model(model)
    return model


def _dense_layers(policy: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """Kernels and biases of the actor's hidden and mean layers, in order."""
    tree = policy["params"]
    dense: dict[str, dict[str, np.ndarray]] = {}
    for path, leaf in jax.tree_util.tree_leaves_with_path(tree):
        names = [str(getattr(part, "key", part)) for part in path]
        if names[-1] in {"kernel", "bias"}:
            dense.setdefault("/".join(names[:-1]), {})[names[-1]] = np.asarray(leaf, np.float32)
    layers = [(name, part["kernel"], part["bias"]) for name, part in dense.items()]
    ordered: list[tuple[np.ndarray, np.ndarray]] = []
    hidden = sorted((x for x in layers if "hidden" in x[0]), key=lambda x: int(x[0].rsplit("_", 1)[1]))
    final = [x for x in layers if "hidden" not in x[0]]
    for _, kernel, bias in [*hidden, *final]:
        ordered.append((kernel, bias))
    return ordered


def export(
    networks: PPONetworks,
    normalizer: Any,
    policy: Any,
    contract: Contract,
    logged: np.ndarray,
    path: Path,
) -> float:
    """Write `path` if, and only if, ONNX Runtime agrees with the trainer's network.

    Args:
        logged: observations that the actor saw in training, (k, observation); as many random ones are
            drawn around them.

    Returns:
        The worst absolute difference of an action.

    Raises:
        UserError: the difference is above the limit; nothing is written.
    """
    rng = np.random.default_rng(0)
    mean, std = np.asarray(normalizer.mean["state"]), np.asarray(normalizer.std["state"])
    random = mean + std * rng.normal(size=(RANDOM_OBSERVATIONS, mean.size))
    observed = np.concatenate([random, logged]).astype(np.float32)
    trial = path.with_suffix(".unchecked")
    write_atomically(trial, to_onnx(normalizer, policy, contract).SerializeToString())
    try:
        session, _ = open_network(trial)
        exported = session.run(None, {"observation": observed})[0]
        worst = float(np.max(np.abs(exported - actor_mean(networks, normalizer, policy, observed))))
        if not worst <= PARITY_LIMIT:
            raise UserError(
                f"export to {path} failed: the ONNX network differs from the trained one by {worst:.1e},"
                f" at most {PARITY_LIMIT:.0e} is allowed"
            )
        trial.replace(path)
    finally:
        trial.unlink(missing_ok=True)
    return worst

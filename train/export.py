"""Export: the actor as an ONNX file that carries its contract, checked against the trainer's own network."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.policies.contract import CONTRACT_KEY, TRAINER_KEY, Contract
from footfall.policies.learned import open_network
from footfall.train.actor import Actor

OPSET = 17
IR_VERSION = 8  # old enough for the ONNX Runtime of a robot's small computer
PARITY_LIMIT = 1e-5
RANDOM_OBSERVATIONS = 1000


def to_onnx(actor: Actor, contract: Contract) -> onnx.ModelProto:
    """The normalised ELU network as an ONNX graph, its contract in the metadata."""
    initializers = [
        numpy_helper.from_array(actor.mean, "mean"),
        numpy_helper.from_array(actor.scale, "std"),
    ]
    nodes = [
        helper.make_node("Sub", ["observation", "mean"], ["centred"]),
        helper.make_node("Div", ["centred", "std"], ["layer_0"]),
    ]
    for index, (kernel, bias) in enumerate(actor.layers):
        initializers += [
            numpy_helper.from_array(kernel, f"kernel_{index}"),
            numpy_helper.from_array(bias, f"bias_{index}"),
        ]
        is_last = index == len(actor.layers) - 1
        output = "action" if is_last else f"dense_{index}"
        inputs = [f"layer_{index}", f"kernel_{index}", f"bias_{index}"]
        nodes.append(helper.make_node("Gemm", inputs, [output]))
        if not is_last:
            nodes.append(helper.make_node("Elu", [output], [f"layer_{index + 1}"]))
    size, actions = actor.layers[0][0].shape[0], actor.layers[-1][0].shape[1]
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["batch", size])],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, ["batch", actions])],
        initializers,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)])
    model.ir_version = IR_VERSION
    helper.set_model_props(model, {CONTRACT_KEY: contract.to_json(), TRAINER_KEY: actor.trainer})
    onnx.checker.check_model(model)
    return model


def export(actor: Actor, contract: Contract, logged: np.ndarray, path: Path) -> float:
    """Write `path` if, and only if, ONNX Runtime agrees with the trainer's network.

    Args:
        logged: observations of the training, (k, observation); random ones around the actor's mean are added.

    Returns:
        The worst absolute difference of an action.

    Raises:
        UserError: the difference is above the limit, or `path` cannot be written; nothing is left there.
    """
    try:
        return _export(actor, contract, logged, path)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from None


def _export(actor: Actor, contract: Contract, logged: np.ndarray, path: Path) -> float:
    rng = np.random.default_rng(0)
    random_observations = actor.mean + actor.scale * rng.normal(size=(RANDOM_OBSERVATIONS, actor.mean.size))
    observed = np.concatenate([random_observations, logged]).astype(np.float32)
    unchecked = path.with_suffix(".unchecked")
    write_atomically(unchecked, to_onnx(actor, contract).SerializeToString())
    try:
        session, _ = open_network(unchecked)
        exported = session.run(None, {"observation": observed})[0]
        worst = float(np.max(np.abs(exported - actor.act(observed))))
        if not worst <= PARITY_LIMIT:
            raise UserError(
                f"export to {path} failed: the ONNX network differs from the trained one by {worst:.1e},"
                f" at most {PARITY_LIMIT:.0e} is allowed"
            )
        unchecked.replace(path)
    finally:
        unchecked.unlink(missing_ok=True)
    return worst

"""Small policies for tests: networks of one layer."""

from pathlib import Path
from types import ModuleType

import numpy as np

from footfall.policies.contract import CONTRACT_KEY, Contract, Term
from footfall.policies.observation import observation_size
from footfall.robots.commands import CommandRange
from footfall.robots.description import load_robot


def write_policy(onnx: ModuleType, path: Path, robot_folder: Path, contract: bool = True) -> Path:
    """An ONNX policy that holds the default pose of a robot."""
    robot = load_robot(robot_folder)
    terms = Contract(
        robot=robot.name,
        digest=robot.digest,
        joints=robot.joint_names,
        control_rate_hz=50.0,
        observation=(Term("gyro"), Term("gravity"), Term("command"), Term("joint_position")),
        default_pose_rad=tuple(robot.default_pose.tolist()),
        action_scale_rad=tuple(robot.action_scale.tolist()),
        kp=tuple(robot.kp.tolist()),
        kd=tuple(robot.kd.tolist()),
        commands=CommandRange((-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0)),
    )
    size, actions = observation_size(terms), len(robot.joint_names)
    return write_network(onnx, path, np.zeros((size, actions), np.float32), terms if contract else None)


def write_network(onnx: ModuleType, path: Path, weights: np.ndarray, contract: Contract | None) -> Path:
    """A network of one layer, action = observation @ weights, (observation size, joints) float32."""
    helper, number = onnx.helper, onnx.TensorProto.FLOAT
    size, actions = weights.shape
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["observation", "weights"], ["action"])],
        "one_layer",
        [helper.make_tensor_value_info("observation", number, ["batch", size])],
        [helper.make_tensor_value_info("action", number, ["batch", actions])],
        [onnx.numpy_helper.from_array(weights, "weights")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    if contract is not None:
        helper.set_model_props(model, {CONTRACT_KEY: contract.to_json()})
    onnx.save(model, path)
    return path

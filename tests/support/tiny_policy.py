"""Small policies for tests: networks of one layer."""

from pathlib import Path
from types import ModuleType

import numpy as np

from footfall.policies.contract import CONTRACT_KEY, Contract, Gait, Term
from footfall.policies.observation import observation_size
from footfall.robots.commands import CommandRange
from footfall.robots.description import Robot, load_robot

WITHIN_ONE = CommandRange((-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0))


def contract_of(
    robot: Robot, *observation: Term, commands: CommandRange = WITHIN_ONE, gait: Gait | None = None
) -> Contract:
    """A contract that fits a robot, at 50 Hz."""
    pose, scale, kp, kd = (
        tuple(values.tolist()) for values in (robot.default_pose, robot.action_scale, robot.kp, robot.kd)
    )
    names = robot.joint_names
    return Contract(robot.name, robot.digest, names, 50.0, observation, pose, scale, kp, kd, commands, gait)


def write_policy(onnx: ModuleType, path: Path, robot_folder: Path, contract: bool = True) -> Path:
    """An ONNX policy that holds the default pose of a robot."""
    robot = load_robot(robot_folder)
    terms = contract_of(robot, *map(Term, ("gyro", "gravity", "command", "joint_position")))
    weights = np.zeros((observation_size(terms), len(robot.joint_names)), np.float32)
    return write_network(onnx, path, weights, terms if contract else None)


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

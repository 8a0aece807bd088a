"""From what a user types to a policy: a hand-written controller, a zoo name, a run folder, an ONNX file."""

from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from footfall.common.errors import UserError
from footfall.policies.controllers.settings import SETTINGS_FILE, configured_controllers
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

ZOO = Path(__file__).parent / "zoo"


class Controller(NamedTuple):
    """Where a hand-written controller is found. Its module is imported when it is asked for, not before."""

    module: str
    name: str  # of its class, which is built from a robot
    about: str
    walks: bool = True
    arguments: tuple[str, ...] = ()  # after the robot


def _gait(name: str) -> Controller:
    """The gait generator, which begins with this gait."""
    about = f"the gait generator's {name}: feet by clock and inverse kinematics"
    return Controller("footfall.policies.controllers.walk", "Walk", about, arguments=(name,))


CONTROLLERS = {
    "stand": Controller(
        "footfall.policies.controllers.stand",
        "Stand",
        "stands in the default pose, levelled by the IMU",
        False,
    ),
    "trot": Controller(
        "footfall.policies.controllers.trot",
        "Trot",
        "trots by clock and inverse kinematics, balanced by the IMU",
    ),
    "mpc": Controller(
        "footfall.policies.controllers.mpc", "Mpc", "convex model-predictive control of the feet's forces"
    ),
    "balance": Controller(
        "footfall.policies.controllers.balance",
        "Balance",
        "stands, by whole-body control of its momentum",
        False,
    ),
    "step": Controller(
        "footfall.policies.controllers.step",
        "Step",
        "walks on two legs: planned footsteps, whole-body control",
    ),
    **{name: _gait(name) for name in ("tripod", "ripple", "wave")},
}


def controllers_of(robot: Robot) -> list[str]:
    """Hand-written controllers that a robot has settings for.

    Raises:
        UserError: the robot's settings are no YAML, or for a controller that does not exist.
    """
    configured = configured_controllers(robot)
    for name in configured:
        if name not in CONTROLLERS:
            path = robot.folder / SETTINGS_FILE
            raise UserError(f"{path}: no controller '{name}': there are {', '.join(CONTROLLERS)}")
    return [name for name in CONTROLLERS if name in configured]


def walking_controllers(robot: Robot) -> list[str]:
    """Those of `controllers_of` that follow a commanded velocity."""
    return [name for name in controllers_of(robot) if CONTROLLERS[name].walks]


def zoo_names(robot: Robot | None = None) -> list[str]:
    """Names of the trained policies that ship with footfall: all, or those for one robot."""
    names = sorted(path.parent.name for path in ZOO.glob("*/policy.onnx"))
    return names if robot is None else [name for name in names if name.startswith(f"{robot.name}-")]


def load_policy(spec: str, robot: Robot) -> Policy:
    """Build the policy that `spec` names, for this robot.

    Raises:
        UserError: there is no such policy, or it does not fit the robot.
    """
    if spec in CONTROLLERS:
        controller = CONTROLLERS[spec]
        return getattr(import_module(controller.module), controller.name)(robot, *controller.arguments)
    from footfall.policies.learned import LearnedPolicy

    if spec in zoo_names():
        return LearnedPolicy(ZOO / spec / "policy.onnx", robot, spec)
    path = Path(spec)
    if spec and path.is_dir():
        return LearnedPolicy(_policy_in(path), robot, path.name or path.resolve().name)
    if path.is_file():
        return LearnedPolicy(path, robot)
    known = ", ".join([*controllers_of(robot), *zoo_names(robot)])
    given = f"no policy '{spec}'" if spec else "no policy is named"
    raise UserError(f"{given}: give one of {known}, a run folder or an .onnx file")


def _policy_in(folder: Path) -> Path:
    """The ONNX file in a run folder."""
    policy = folder / "policy.onnx"
    if policy.is_file():
        return policy
    if not (folder / "run.yaml").is_file():
        raise UserError(f"no policy in {folder}: it is not a run folder, which 'footfall train' makes")
    if not any((folder / "checkpoints").glob("*")):
        raise UserError(
            f"no policy in {folder}: its training kept no checkpoint yet;"
            f" go on with 'footfall train --resume {folder}'"
        )
    raise UserError(f"{folder} holds no policy.onnx: make it with 'footfall export {folder}'")

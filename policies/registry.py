"""Policies by name: a controller, a zoo name, a run folder, an ONNX file or a class."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from footfall.common.errors import UserError, naming
from footfall.common.hints import did_you_mean
from footfall.common.outside import is_import_path, shipped
from footfall.policies.controllers.settings import (
    SETTINGS_FILE,
    configured_controllers,
    controller_settings,
)
from footfall.policies.gaits import gait_names
from footfall.policies.own import load_own
from footfall.policies.policy import Policy
from footfall.policies.spec import read_changes, self_contained, short_name, split_spec
from footfall.robots.description import Robot

ZOO = Path(__file__).parent / "zoo"
GET_UP = "-getup"  # suffix, after a robot's name, of its get-up policy in the zoo

_ROOM = "footfall.policies.controllers"  # package of the hand-written controllers


class Controller(NamedTuple):
    """A hand-written controller. Its module is imported when the controller is built."""

    import_path: str  # MODULE:CLASS, built from a robot and its settings
    settings: str  # MODULE:NAME of its settings' dataclass
    about: str
    walks: bool = True
    arguments: tuple[str, ...] = ()  # further arguments between robot and settings


def _gait(name: str) -> Controller:
    """The gait generator with this gait."""
    about = f"gait generator with {name}: feet by clock and inverse kinematics"
    return Controller(
        f"{_ROOM}.walk:Walk",
        f"{_ROOM}.walk.config:WalkConfig",
        about,
        walks=True,
        arguments=(name,),
    )


def _flight(name: str) -> Controller:
    """A gait with a flight phase, for which forces have to be planned."""
    about = f"{name}: model-predictive control that plans over the flight phase"
    return Controller(f"{_ROOM}.mpc:Mpc", f"{_ROOM}.mpc.config:MpcConfig", about)


FLIGHT = ("gallop", "pronk")  # gaits of the MPC; the gait generator has all others

CONTROLLERS = {
    "stand": Controller(
        f"{_ROOM}.stand:Stand",
        f"{_ROOM}.stand:StandConfig",
        "stands in the default pose, levelled by the IMU",
        walks=False,
    ),
    "mpc": Controller(
        f"{_ROOM}.mpc:Mpc",
        f"{_ROOM}.mpc.config:MpcConfig",
        "convex model-predictive control of the feet's forces",
    ),
    "mpc-wbc": Controller(
        f"{_ROOM}.mpc.whole_body:MpcWholeBody",
        f"{_ROOM}.mpc.whole_body:MpcWholeBodyConfig",
        "the same plan, executed by whole-body control",
    ),
    "balance": Controller(
        f"{_ROOM}.balance:Balance",
        f"{_ROOM}.balance:BalanceConfig",
        "stands by whole-body control of its momentum",
        walks=False,
    ),
    "step": Controller(
        f"{_ROOM}.step:Step",
        f"{_ROOM}.step.config:StepConfig",
        "walks on two legs: planned footsteps, whole-body control",
    ),
    "jump": Controller(
        f"{_ROOM}.jump:Jump",
        f"{_ROOM}.jump.config:JumpConfig",
        "stands, and jumps forward during a forward command",
        walks=False,
    ),
    **{name: _flight(name) if name in FLIGHT else _gait(name) for name in gait_names()},
}


def controllers_of(robot: Robot) -> list[str]:
    """Hand-written controllers for which a robot has settings, in the order of its file.

    Raises:
        UserError: the robot's settings are not YAML, or name an unknown controller.
    """
    configured = configured_controllers(robot)
    for name in configured:
        if name not in CONTROLLERS:
            path = robot.folder / SETTINGS_FILE
            raise UserError(f"{path}: no controller '{name}': there are {', '.join(CONTROLLERS)}")
    return list(configured)


def walking_controllers(robot: Robot) -> list[str]:
    """Controllers of a robot that follow a velocity command."""
    return [name for name in controllers_of(robot) if CONTROLLERS[name].walks]


def first_of_each_kind(names: Iterable[str]) -> list[str]:
    """The first hand-written controller of each class: one of the gait generator, one of the MPC, ..."""
    found: dict[str, str] = {}
    for name in names:
        found.setdefault(CONTROLLERS[name].import_path, name)
    return list(found.values())


def zoo_names(robot: Robot | None = None) -> list[str]:
    """Names of the trained policies that ship with footfall: all, or those of one robot."""
    names = sorted(path.parent.name for path in ZOO.glob("*/policy.onnx"))
    return names if robot is None else [name for name in names if name.startswith(f"{robot.name}-")]


def get_up_name(robot: Robot) -> str:
    """Name of the zoo policy with which this robot gets up after a fall.

    Raises:
        UserError: the zoo has none.
    """
    name = f"{robot.name}{GET_UP}"
    if name not in zoo_names():
        raise UserError(f"the zoo has no get-up policy for {robot.name}: name one with --get-up")
    return name


def load_policy(spec: str, robot: Robot) -> Policy:
    """Build the policy `spec` for this robot. The spec of a controller may include settings (`spec.py`).

    Raises:
        UserError: there is no such policy, or it does not fit the robot.
    """
    name, parts = split_spec(spec)
    if name in CONTROLLERS:
        controller = CONTROLLERS[name]
        settings = load_settings(spec, robot)
        with naming(name):
            policy = shipped(controller.import_path)(robot, *controller.arguments, settings)
        policy.name = short_name(name, parts)
        return policy
    from footfall.policies.learned import LearnedPolicy

    if spec in zoo_names():
        return LearnedPolicy(ZOO / spec / "policy.onnx", robot, spec)
    path = Path(spec)
    if is_import_path(spec) and not path.exists():
        return load_own(spec, robot)
    if spec and path.is_dir():
        return LearnedPolicy(_policy_in(path), robot, path.name or path.resolve().name)
    if path.is_file():
        return LearnedPolicy(path, robot)
    known = [*controllers_of(robot), *zoo_names(robot)]
    problem = f"no policy '{spec}'" if spec else "the policy's name is empty"
    raise UserError(
        f"{problem}: give one of {', '.join(known)}, a run folder, an .onnx file or MODULE:CLASS"
        f"{did_you_mean(spec, known)}"
    )


def load_settings(spec: str, robot: Robot) -> Any:
    """Settings of the hand-written controller in `spec`, a dataclass; None for any other policy.

    Raises:
        UserError: the robot has no settings for it, or they are invalid.
    """
    name, parts = split_spec(spec)
    if name not in CONTROLLERS:
        return None
    cls = shipped(CONTROLLERS[name].settings)
    return controller_settings(robot, name, cls, read_changes(name, parts))


def lasting_spec(spec: str) -> str:
    """A spec with the same meaning in another folder and after a change of its files.

    Raises:
        UserError: a settings file cannot be read.
    """
    name, parts = split_spec(spec)
    if name in CONTROLLERS:
        return self_contained(name, parts)
    path = Path(spec)
    return str(path.resolve()) if path.exists() else spec


def changed_settings(spec: str) -> list[str]:
    """Changes of a hand-written controller's settings in a spec, as KEY=VALUE.

    Raises:
        UserError: a settings file cannot be read.
    """
    return split_spec(lasting_spec(spec))[1] if split_spec(spec)[0] in CONTROLLERS else []


def _policy_in(folder: Path) -> Path:
    """ONNX file of a run folder."""
    policy = folder / "policy.onnx"
    if policy.is_file():
        return policy
    if not (folder / "run.yaml").is_file():
        raise UserError(f"no policy in {folder}: it is not a run folder of 'footfall train'")
    if not any((folder / "checkpoints").glob("*")):
        raise UserError(
            f"no policy in {folder}: the run has no checkpoint yet;"
            f" continue it with 'footfall train --resume {folder}'"
        )
    raise UserError(f"{folder} has no policy.onnx: make it with 'footfall export {folder}'")

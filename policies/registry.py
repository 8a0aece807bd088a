"""From what a user types to a policy: a hand-written controller, a zoo name, a run folder, an ONNX file."""

from pathlib import Path

from footfall.common.errors import UserError
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

ZOO = Path(__file__).parent / "zoo"
CONTROLLERS = ("stand", "trot", "mpc")


def zoo_names() -> list[str]:
    """Names of the trained policies that ship with footfall."""
    return sorted(path.parent.name for path in ZOO.glob("*/policy.onnx"))


def load_policy(spec: str, robot: Robot) -> Policy:
    """Build the policy that `spec` names, for this robot.

    Raises:
        UserError: there is no such policy, or it does not fit the robot.
    """
    if spec in CONTROLLERS:
        return _controller(spec, robot)
    from footfall.policies.learned import LearnedPolicy

    if spec in zoo_names():
        return LearnedPolicy(ZOO / spec / "policy.onnx", robot, spec)
    path = Path(spec)
    if path.is_dir():
        if not (path / "policy.onnx").is_file():
            raise UserError(f"{path} holds no policy.onnx: make it with 'footfall export {path}'")
        return LearnedPolicy(path / "policy.onnx", robot, path.name)
    if path.is_file():
        return LearnedPolicy(path, robot)
    known = ", ".join([*CONTROLLERS, *zoo_names()])
    raise UserError(f"no policy '{spec}': give one of {known}, a run folder or an .onnx file")


def _controller(name: str, robot: Robot) -> Policy:
    if name == "stand":
        from footfall.policies.controllers.stand import Stand

        return Stand(robot)
    if name == "trot":
        from footfall.policies.controllers.trot import Trot

        return Trot(robot)
    from footfall.policies.controllers.mpc.controller import Mpc

    return Mpc(robot)

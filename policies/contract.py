"""Contract of a learned policy. Training writes it, the ONNX file carries it, the deploy loop checks it."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from footfall.common.config import require_between, require_positive, structure, unstructure
from footfall.common.errors import UserError
from footfall.robots.commands import CommandRange
from footfall.robots.description import Robot

MAX_CONTROL_HZ = 1000.0  # highest rate of a learned policy

CONTRACT_KEY = "footfall.contract"  # key in the metadata of an ONNX file
TRAINER_KEY = "footfall.trainer"
VERSION = 1


@dataclass(frozen=True)
class Term:
    """One observation term: name, scale and length of its history."""

    name: str  # name of a term in policies/observation.py, or MODULE:NAME
    scale: float = 1.0  # factor of its values
    history: int = 1  # number of observations, including the newest
    settings: dict[str, Any] = field(default_factory=dict, hash=False)  # parameters of the term

    def __post_init__(self) -> None:
        require_positive(self, "history")


@dataclass(frozen=True)
class Gait:
    """A gait clock, and a reference motion to which the actions are added.

    The position reference of joint j at clock p is amplitude_rad[j] * planned_lift(p, phase[j], duty): a half
    sine over the foot's swing (policies/gaits.py).
    """

    frequency_hz: float  # cycles per second
    phase: tuple[float, ...]  # phase of each joint's foot, cycles
    amplitude_rad: tuple[float, ...]  # amplitude of each joint's reference motion; 0 for none
    duty: float = 0.5  # share of the cycle in which a foot is in stance

    def __post_init__(self) -> None:
        require_positive(self, "frequency_hz")
        if not 0.0 < self.duty < 1.0:
            raise ValueError(f"duty must be between 0 and 1, not {self.duty}")


@dataclass(frozen=True)
class Contract:
    """Everything that training and deployment must agree on. Per-joint tuples are in joint order."""

    robot: str  # name of the robot
    digest: str  # digest of the description used in training
    joints: tuple[str, ...]  # joint names, in joint order
    control_rate_hz: float  # rate of the policy's steps
    observation: tuple[Term, ...]  # terms in order, each with its history
    default_pose_rad: tuple[float, ...]  # position targets for a zero action
    action_scale_rad: tuple[float, ...]  # change of the position target per unit of action
    kp: tuple[float, ...]  # stiffness, N m/rad
    kd: tuple[float, ...]  # damping, N m s/rad
    commands: CommandRange  # command ranges used in training
    gait: Gait | None = None  # None: the policy has no gait clock
    standing_command: float = 0.1  # norm below which a command means to stand still; 0: step in place
    version: int = field(default=VERSION)  # version of this format

    def __post_init__(self) -> None:
        require_between(self, 1.0, MAX_CONTROL_HZ, "control_rate_hz")
        if not self.observation:
            raise ValueError("observation has no terms")
        for name, numbers in self._per_joint():
            if len(numbers) != len(self.joints):
                raise ValueError(f"{name} has {len(numbers)} numbers for {len(self.joints)} joints")

    def _per_joint(self) -> Iterator[tuple[str, tuple[float, ...]]]:
        for name in ("default_pose_rad", "action_scale_rad", "kp", "kd"):
            yield name, getattr(self, name)
        if self.gait is not None:
            yield "gait.phase", self.gait.phase
            yield "gait.amplitude_rad", self.gait.amplitude_rad

    def to_json(self) -> str:
        """JSON text at full precision; `from_json` returns an equal contract."""
        return json.dumps(unstructure(self))

    @staticmethod
    def from_json(text: str, source: str) -> "Contract":
        """Contract in a JSON text; UserError if the text is not a contract."""
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:  # RecursionError: nested too deeply
            raise UserError(f"{source}: its contract is not JSON ({error})") from None
        return structure(data, Contract, source)

    def mismatches(self, robot: Robot) -> list[str]:
        """Differences between this contract and a robot, one line each; empty if the policy fits.
        Per-joint values are compared only if the joints are the same.
        """
        found = []
        expected: list[tuple[str, Sequence[object], Sequence[object]]] = [
            ("robot", [self.robot], [robot.name]),
            ("joints", self.joints, robot.joint_names),
            ("version", [self.version], [VERSION]),
        ]
        if self.joints == robot.joint_names:
            expected += [
                ("default_pose_rad", self.default_pose_rad, robot.default_pose.tolist()),
                ("kp", self.kp, robot.kp.tolist()),
                ("kd", self.kd, robot.kd.tolist()),
            ]
        for name, policy_values, robot_values in expected:
            if difference := _difference(policy_values, robot_values):
                found.append(f"{name}: policy has {difference}")
        if not found and self.digest != robot.digest:
            found.append(
                f"digest: policy was trained on description {self.digest}, robot has {robot.digest}"
                " (its model, motors or feet changed)"
            )
        return found


def _difference(policy_values: Sequence[object], robot_values: Sequence[object]) -> str:
    """First difference and the number of further ones; empty if both are equal."""
    if len(policy_values) != len(robot_values):
        return f"{len(policy_values)}, robot has {len(robot_values)}"
    differing = [
        (of_policy, of_robot)
        for of_policy, of_robot in zip(policy_values, robot_values, strict=True)
        if of_policy != of_robot
    ]
    if not differing:
        return ""
    (of_policy, of_robot), more = differing[0], len(differing) - 1
    return f"{of_policy}, robot has {of_robot}" + (f", and {more} more differ" if more else "")

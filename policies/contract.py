"""What a policy is made of. Training writes it, the ONNX file carries it, the deploy loop checks it."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from footfall.common.config import require_between, require_positive, structure, unstructure
from footfall.common.errors import UserError
from footfall.robots.commands import CommandRange
from footfall.robots.description import Robot

FASTEST_CONTROL_HZ = 1000.0  # no learned policy is run faster

CONTRACT_KEY = "footfall.contract"  # of an ONNX file's metadata
TRAINER_KEY = "footfall.trainer"
VERSION = 1


@dataclass(frozen=True)
class Term:
    """One observation term: its name, a scale, and how many past frames."""

    name: str  # in policies/observation.py, or MODULE:NAME
    scale: float = 1.0  # that its numbers are multiplied by
    history: int = 1  # frames, the newest among them
    settings: dict[str, Any] = field(default_factory=dict, hash=False)  # parameters of the term

    def __post_init__(self) -> None:
        require_positive(self, "history")


@dataclass(frozen=True)
class Gait:
    """A clock, and a reference motion around which the actions are residuals.

    The position reference of joint j at clock p is amplitude_rad[j] * planned_lift(p, phase[j], duty), a half
    sine over the foot's swing (policies/gaits.py).
    """

    frequency_hz: float  # cycles a second
    phase: tuple[float, ...]  # of each joint's foot, cycles
    amplitude_rad: tuple[float, ...]  # of each joint's reference motion; 0 for none
    duty: float = 0.5  # share of the cycle that a foot stands

    def __post_init__(self) -> None:
        require_positive(self, "frequency_hz")
        if not 0.0 < self.duty < 1.0:
            raise ValueError(f"duty must be between 0 and 1, not {self.duty}")


@dataclass(frozen=True)
class Contract:
    """All that training and deployment must agree on. Per-joint tuples are in joint order."""

    robot: str  # its name
    digest: str  # of the description that it was trained on
    joints: tuple[str, ...]  # names, in joint order
    control_rate_hz: float  # of the policy's steps
    observation: tuple[Term, ...]  # in this order, each with its history
    default_pose_rad: tuple[float, ...]  # position targets of a zero action
    action_scale_rad: tuple[float, ...]  # position target per unit of action
    kp: tuple[float, ...]  # stiffness, N m/rad
    kd: tuple[float, ...]  # damping, N m s/rad
    commands: CommandRange  # that it was trained on
    gait: Gait | None = None  # none if the policy has no clock
    standing_command: float = 0.1  # commands of a smaller norm mean: stand still; 0: step in place
    version: int = field(default=VERSION)  # of this form

    def __post_init__(self) -> None:
        require_between(self, 1.0, FASTEST_CONTROL_HZ, "control_rate_hz")
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
        """JSON text at full precision: it reads back to an equal contract."""
        return json.dumps(unstructure(self))

    @staticmethod
    def from_json(text: str, source: str) -> "Contract":
        """Raises UserError if the text is no contract."""
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:  # also too many digits, or brackets
            raise UserError(f"{source}: its contract is not JSON ({error})") from None
        return structure(data, Contract, source)

    def mismatches(self, robot: Robot) -> list[str]:
        """Differences between this contract and a robot, one line each; empty if the policy fits.

        What each joint has is compared where the joints are the same ones.
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
        for name, mine, theirs in expected:
            if difference := _difference(mine, theirs):
                found.append(f"{name}: policy has {difference}")
        if not found and self.digest != robot.digest:
            found.append(
                f"digest: policy was trained on description {self.digest}, robot has {robot.digest}"
                " (its model, motors or feet changed)"
            )
        return found


def _difference(mine: Sequence[object], theirs: Sequence[object]) -> str:
    """The first of what differs, and how many more do; empty if nothing does."""
    if len(mine) != len(theirs):
        return f"{len(mine)}, robot has {len(theirs)}"
    pairs = [(own, other) for own, other in zip(mine, theirs, strict=True) if own != other]
    if not pairs:
        return ""
    (own, other), more = pairs[0], len(pairs) - 1
    return f"{own}, robot has {other}" + (f", and {more} more differ" if more else "")

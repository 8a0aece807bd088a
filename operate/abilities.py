"""What a policy on a robot can be commanded to do."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from footfall.deploy.command_source import Offer
from footfall.deploy.steering import offer_of
from footfall.policies.policy import Policy
from footfall.policies.registry import CONTROLLERS, load_settings
from footfall.policies.spec import split_spec
from footfall.robots.commands import CommandRange
from footfall.robots.description import Robot

ZERO_RANGES = CommandRange((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
COMMAND_MARGIN = 1.2  # commands must exceed a policy's standing threshold by this factor to move the robot


@dataclass(frozen=True)
class Limits:
    """Range of commands that a policy follows."""

    ranges: CommandRange
    min_norm: float = 0.0  # commands with a smaller norm may be treated as zero

    @property
    def yaw_rad_s(self) -> float:
        """Maximum yaw rate possible in both directions."""
        return min(-self.ranges.yaw_rad_s[0], self.ranges.yaw_rad_s[1])

    @property
    def omnidirectional(self) -> bool:
        """Whether the robot can walk and turn in all directions."""
        return all(low < 0.0 < high for low, high in vars(self.ranges).values())


class Abilities(NamedTuple):
    """Capabilities of one policy of a run."""

    limits: Limits
    offer: Offer


def abilities_of(policies: Mapping[str, Policy], robot: Robot) -> Callable[[str], Abilities]:
    """Return a function from a policy's name to its abilities.

    Args:
        policies: selectable policies of a run, by spec.
        robot: the robot they run on.
    """
    names = tuple(policy.name for policy in policies.values())
    by_name = {
        policy.name: Abilities(limits_of(spec, policy, robot), offer_of(policy)._replace(policies=names))
        for spec, policy in policies.items()
    }
    return by_name.__getitem__


def limits_of(spec: str, policy: Policy, robot: Robot) -> Limits:
    """Commands that are within the ranges of both the robot and the policy's training."""
    robot_ranges = robot.description.commands
    if (contract := policy.contract) is not None:
        ranges = _intersection(robot_ranges, contract.commands)
        return Limits(ranges, COMMAND_MARGIN * contract.standing_command)
    name, _ = split_spec(spec)
    if name in CONTROLLERS and not CONTROLLERS[name].walks:
        return Limits(ZERO_RANGES)
    shaping: Any = getattr(load_settings(spec, robot), "command", None)
    return Limits(robot_ranges, COMMAND_MARGIN * getattr(shaping, "standing_command", 0.0))


def _intersection(first: CommandRange, second: CommandRange) -> CommandRange:
    axes = zip(vars(first).values(), vars(second).values(), strict=True)
    return CommandRange(*((max(a[0], b[0]), min(a[1], b[1])) for a, b in axes))

"""What a policy on a robot can be asked for."""

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

NOWHERE = CommandRange((0.0, 0.0), (0.0, 0.0), (0.0, 0.0))
ABOVE = 1.2  # a command that shall move the robot, over the smallest that does


@dataclass(frozen=True)
class Limits:
    """Commands that a policy follows."""

    ranges: CommandRange
    slowest: float = 0.0  # commands of a smaller norm may mean: stand still

    @property
    def yaw_rad_s(self) -> float:
        """Highest yaw rate in both directions."""
        return min(-self.ranges.yaw_rad_s[0], self.ranges.yaw_rad_s[1])

    @property
    def anywhere(self) -> bool:
        """Whether the robot can go and turn in every direction."""
        return all(low < 0.0 < high for low, high in vars(self.ranges).values())


class Abilities(NamedTuple):
    """What one policy of a run can do."""

    limits: Limits
    offer: Offer


def abilities_of(policies: Mapping[str, Policy], robot: Robot) -> Callable[[str], Abilities]:
    """Abilities by name of a policy.

    Args:
        policies: those that may decide in a run, by spec.
        robot: on which they run.
    """
    names = tuple(policy.name for policy in policies.values())
    found = {
        policy.name: Abilities(limits_of(spec, policy, robot), offer_of(policy)._replace(policies=names))
        for spec, policy in policies.items()
    }
    return found.__getitem__


def limits_of(spec: str, policy: Policy, robot: Robot) -> Limits:
    """What a policy can be asked for: within the robot's ranges and those that the policy was trained on."""
    own = robot.description.commands
    if (contract := policy.contract) is not None:
        return Limits(_common(own, contract.commands), ABOVE * contract.standing_command)
    name, _ = split_spec(spec)
    if name in CONTROLLERS and not CONTROLLERS[name].walks:
        return Limits(NOWHERE)
    shaping: Any = getattr(load_settings(spec, robot), "command", None)
    return Limits(own, ABOVE * getattr(shaping, "standing_command", 0.0))


def _common(one: CommandRange, other: CommandRange) -> CommandRange:
    pairs = zip(vars(one).values(), vars(other).values(), strict=True)
    return CommandRange(*((max(a[0], b[0]), min(a[1], b[1])) for a, b in pairs))

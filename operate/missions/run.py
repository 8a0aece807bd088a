"""A mission with all that a run of it needs, from plain data."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from footfall.common.errors import UserError
from footfall.operate.abilities import abilities_of
from footfall.operate.missions.mission import Mission, mission_of
from footfall.operate.missions.source import MissionSource
from footfall.policies.policy import Policy
from footfall.policies.registry import lasting_spec, load_policy
from footfall.robots.description import Robot


class MissionRun(NamedTuple):
    """A mission that has not begun."""

    source: MissionSource
    others: dict[str, Policy]  # policies that it names beside the first one, by spec


def mission_run(data: Mapping[str, Any], where: str, spec: str, policy: Policy, robot: Robot) -> MissionRun:
    """A mission from plain data.

    Args:
        data: as `mission_of` takes it.
        where: begins each message.
        spec: names the policy that decides at first.
        policy: that one.
        robot: on which it runs.

    Raises:
        UserError: the data is no mission, names a policy that there is not, or a step cannot be done.
    """
    mission = mission_of(data, where)
    others = policies_of(mission, [policy.name], robot)
    abilities = abilities_of({spec: policy, **others}, robot)
    return MissionRun(MissionSource(mission, policy.name, abilities), others)


def policies_of(mission: Mission, loaded: Iterable[str], robot: Robot) -> dict[str, Policy]:
    """Policies that a mission names beside those that are loaded, by spec.

    Raises:
        UserError: it names a policy that there is not.
    """
    missing = [name for name in mission.policies if name not in set(loaded)]
    try:
        return {lasting_spec(name): load_policy(name, robot) for name in missing}
    except UserError as error:
        raise UserError(f"{mission.source}: {error}") from None

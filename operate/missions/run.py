"""Prepares a mission, given as plain data, for a run."""

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
    """A mission before its start."""

    source: MissionSource
    others: dict[str, Policy]  # further policies used by the mission, by spec


def mission_run(data: Mapping[str, Any], where: str, spec: str, policy: Policy, robot: Robot) -> MissionRun:
    """Prepare a mission given as plain data.

    Args:
        data: content as for `mission_of`.
        where: prefix of each message.
        spec: spec of the policy in control at the start.
        policy: the policy.
        robot: the robot it runs on.

    Raises:
        UserError: the data is not a mission, a policy does not exist, or a step is impossible.
    """
    mission = mission_of(data, where)
    others = policies_of(mission, [policy.name], robot)
    abilities = abilities_of({spec: policy, **others}, robot)
    return MissionRun(MissionSource(mission, policy.name, abilities), others)


def policies_of(mission: Mission, loaded: Iterable[str], robot: Robot) -> dict[str, Policy]:
    """Load policies used by a mission in addition to the loaded ones; returns them by spec.

    Raises:
        UserError: a policy does not exist.
    """
    missing = [name for name in mission.policies if name not in set(loaded)]
    try:
        return {lasting_spec(name): load_policy(name, robot) for name in missing}
    except UserError as error:
        raise UserError(f"{mission.source}: {error}") from None

"""`footfall replay`."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from footfall.common.errors import UserError
from footfall.options import AS_TYPED, PolicyName

if TYPE_CHECKING:
    from footfall.robots.description import Robot


@Parameter(name="*")
@dataclass(frozen=True)
class ReplayOptions:
    """What to replay with."""

    policy: Annotated[PolicyName | None, AS_TYPED] = None
    """Policy to ask again (default: the one that the log names)."""
    robot: Annotated[str | None, AS_TYPED] = None
    """Name of a robot, or a folder with its robot.yaml (default: the one that the log names)."""
    tolerance: float = 0.0
    """Differences up to this are not reported."""


def replay(log: Path, /, *, options: ReplayOptions = ReplayOptions()) -> int:
    """Feed a log's readings to its policy again; exit 0 if it decides the same, 1 if not."""
    from footfall.deploy.replay import read_log
    from footfall.deploy.replay import replay as replay_log
    from footfall.policies.registry import load_policy
    from footfall.robots.description import load_robot

    named: dict[str, str] = {}
    if options.policy is None or options.robot is None:
        named = read_log(log).metadata
    robot = load_robot(options.robot) if options.robot is not None else _logged_robot(named)
    try:
        policy = load_policy(options.policy or named["policy_spec"], robot)
    except UserError as error:
        if options.policy is not None:
            raise
        raise UserError(f"the log was made with a policy that is not here ({error}): give --policy") from None
    result = replay_log(log, policy, options.tolerance)
    print(f"{result.steps} policy steps" + ("" if result.complete else ", of a run that was cut short"))
    if result.first_difference:
        print(f"first difference: {result.first_difference}")
        print(f"worst difference: {result.worst_difference:.3g}")
        return 1
    print(f"the same decisions (worst difference {result.worst_difference:.3g})")
    return 0


def _logged_robot(named: dict[str, str]) -> "Robot":
    """The robot that a log was made with, wherever it lies.

    Raises:
        UserError: it is not here, or has changed since.
    """
    from footfall.robots.description import load_robot

    for where in (named["robot"], named["robot_folder"]):
        with suppress(UserError):
            robot = load_robot(where)
            if robot.digest == named["robot_digest"]:
                return robot
    raise UserError(
        f"the log was made with robot {named['robot']} of {named['robot_folder']},"
        " which is not here or has changed since: give --robot"
    )

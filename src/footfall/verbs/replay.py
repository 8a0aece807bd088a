"""`footfall replay`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from footfall.common.errors import UserError
from footfall.options import AS_TYPED, PolicyName

if TYPE_CHECKING:
    from footfall.policies.policy import Policy
    from footfall.robots.description import Robot


@Parameter(name="*")
@dataclass(frozen=True)
class ReplayOptions:
    """What to replay with."""

    policy: Annotated[PolicyName | None, AS_TYPED] = None
    """Policy to ask again (default: the one that the log names); others of the run are those of the log."""
    robot: Annotated[str | None, AS_TYPED] = None
    """Name of a robot, or a folder with its robot.yaml (default: the one that the log names)."""
    tolerance: float = 0.0
    """Differences up to this are not reported."""


def replay(log: Path, /, *, options: ReplayOptions = ReplayOptions()) -> int:
    """Feed a log's readings to its policy again; exit 0 if it decides the same, 1 if not."""
    from footfall.deploy.log_analysis.robot import logged_robot
    from footfall.deploy.log_file import read_log
    from footfall.deploy.replay import GET_UP, OTHERS
    from footfall.deploy.replay import replay as replay_log
    from footfall.policies.registry import load_policy
    from footfall.robots.description import load_robot

    named = read_log(log, topics=())
    robot = logged_robot(named) if options.robot is None else load_robot(options.robot)
    if options.policy is None:
        policy = _logged_policy(named.text("policy_spec"), robot)
    else:
        policy = load_policy(options.policy, robot)
    others = [_logged_policy(str(spec), robot) for spec in named.metadata.get(OTHERS) or ()]
    spec = named.text(GET_UP) if GET_UP in named.metadata else ""
    get_up = _logged_policy(spec, robot) if spec else None
    result = replay_log(log, policy, options.tolerance, others, get_up)
    print(
        f"{result.steps} policy steps"
        + ("" if result.complete else ", of a run that was cut short")
        + (f", {result.damaged} damaged parts left out" if result.damaged else "")
    )
    if result.first_difference:
        print(f"first difference: {result.first_difference}")
        print(f"worst difference: {result.worst_difference:.3g}")
        return 1
    print(f"the same decisions (worst difference {result.worst_difference:.3g})")
    return 0


def _logged_policy(spec: str, robot: "Robot") -> "Policy":
    """A policy that a log was made with. Raises UserError if it is not here."""
    from footfall.policies.registry import load_policy

    try:
        return load_policy(spec, robot)
    except UserError as error:
        raise UserError(f"the log was made with a policy that is not here ({error}): give --policy") from None

"""`footfall replay`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from footfall.common.errors import UserError
from footfall.options import AS_TYPED

if TYPE_CHECKING:
    from footfall.policies.policy import Policy
    from footfall.robots.description import Robot


@Parameter(name="*")
@dataclass(frozen=True)
class ReplayOptions:
    """Policy, robot and tolerance of the replay."""

    policy: Annotated[str | None, AS_TYPED] = None
    """Policy to run again (default: the log's policy); other policies of the run come from the log."""
    robot: Annotated[str | None, AS_TYPED] = None
    """Name of a robot, or a folder with its robot.yaml (default: the log's robot)."""
    tolerance: float = 0.0
    """Smaller differences are not reported."""


def replay(log: Path, /, *, options: ReplayOptions = ReplayOptions()) -> int:
    """Feed a log's readings to its policy again; exit 0 if its decisions are the same, 1 if not."""
    from footfall.deploy.log_analysis.robot import check_joints, logged_robot
    from footfall.deploy.log_file import read_log
    from footfall.deploy.replay import GET_UP, OTHERS
    from footfall.deploy.replay import replay as replay_log
    from footfall.policies.registry import load_policy
    from footfall.robots.description import load_robot

    header = read_log(log, topics=())
    robot = logged_robot(header) if options.robot is None else load_robot(options.robot)
    check_joints(header, robot)
    if options.policy is None:
        policy = _logged_policy(header.text("policy_spec"), robot)
    else:
        policy = load_policy(options.policy, robot)
    others = [_logged_policy(str(spec), robot) for spec in header.metadata.get(OTHERS) or ()]
    spec = header.text(GET_UP) if GET_UP in header.metadata else ""
    get_up = _logged_policy(spec, robot) if spec else None
    result = replay_log(log, policy, options.tolerance, others, get_up)
    print(
        f"{result.steps} policy steps"
        + ("" if result.complete else ", of a truncated run")
        + (f", {result.damaged} damaged parts skipped" if result.damaged else "")
    )
    if result.first_difference:
        print(f"first difference: {result.first_difference}")
        print(f"largest difference: {result.worst_difference:.3g}")
        return 1
    print(f"the same decisions (largest difference {result.worst_difference:.3g})")
    return 0


def _logged_policy(spec: str, robot: "Robot") -> "Policy":
    """Policy named in a log. Raises UserError if it is not available."""
    from footfall.policies.registry import load_policy

    try:
        return load_policy(spec, robot)
    except UserError as error:
        raise UserError(f"the log's policy is not available ({error}): give --policy") from None

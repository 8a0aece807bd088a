"""A user's controller, named as MODULE:CLASS."""

from footfall.common.errors import UserError
from footfall.common.outside import find, one_line
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

_PARTS = ("name", "rate_hz", "needs_estimate", "contract", "notes", "reset", "act", "stance")  # of `Policy`


def load_own(import_path: str, robot: Robot) -> Policy:
    """Build the class at `module:Class` as `Class(robot)`; modules in the working folder can be imported.

    Raises:
        UserError: there is no such module or class, or its object is not a `Policy`.
    """
    cls = find(import_path, "policy")
    if not isinstance(cls, type):
        raise UserError(f"no policy '{import_path}': it is not a class")
    try:
        policy = cls(robot)
    except Exception as error:  # of any type, because the class is the user's
        raise UserError(f"{import_path} cannot be built: {one_line(error)}") from error
    if missing := [part for part in _PARTS if not hasattr(policy, part)]:
        raise UserError(
            f"{import_path} is not a policy: it has no {', '.join(missing)} (see policies/policy.py)"
        )
    return policy

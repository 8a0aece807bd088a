"""A controller of the user's own, named by where Python finds it: MODULE:CLASS."""

import re
import sys
import traceback
from importlib import import_module
from pathlib import Path
from types import ModuleType

from footfall.common.errors import UserError
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

_PLACE = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")
_PARTS = ("name", "rate_hz", "needs_estimate", "contract", "notes", "reset", "act", "stance")  # of `Policy`


def is_place(spec: str) -> bool:
    """Whether this reads MODULE:CLASS."""
    return _PLACE.fullmatch(spec) is not None


def load_own(place: str, robot: Robot) -> Policy:
    """The class at `module:Class` built as `Class(robot)`; modules of the working folder can be imported.

    Raises:
        UserError: there is no such module or class, or it is no `Policy`.
    """
    module_name, _, name = place.partition(":")
    module = _imported(module_name)
    cls = getattr(module, name, None)
    if not isinstance(cls, type):
        raise UserError(f"no policy '{place}': {module.__file__} has no class '{name}'")
    try:
        policy = cls(robot)
    except Exception as error:  # whatever it is, it is the class's
        raise UserError(f"{place} cannot be built: {_in_a_line(error)}") from error
    if lacking := [part for part in _PARTS if not hasattr(policy, part)]:
        raise UserError(f"{place} is no policy: it has no {', '.join(lacking)} (see policies/policy.py)")
    return policy


def _imported(name: str) -> ModuleType:
    folder = str(Path.cwd())
    if folder not in sys.path:
        sys.path.append(folder)  # last: no file of the user's replaces a library
    try:
        return import_module(name)
    except Exception as error:  # whatever it is, it is the module's
        lacking = error.name if isinstance(error, ModuleNotFoundError) else None
        if lacking is None or not f"{name}.".startswith(f"{lacking}."):
            raise UserError(f"importing '{name}': {_in_a_line(error)}") from error
    raise UserError(f"no module '{lacking}': neither {folder} nor what is installed has it to import")


def _in_a_line(error: Exception) -> str:
    """What went wrong, and in which line of the user's."""
    text, *_ = str(error).splitlines() or [""]
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {text} ({Path(place.filename).name}:{place.lineno})"

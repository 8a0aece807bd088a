"""footfall: legged robots, from a description to a policy on motors.

The Python API. Each name is imported from its module at first use, so that `import footfall` is fast:

    from footfall import Episode, load_policy, load_robot, run_episode

    robot = load_robot("go1")
    policy = load_policy("trot", robot)
    trace = run_episode(robot, policy, Episode(lambda time_s: np.array([0.5, 0.0, 0.0]), duration_s=5.0))
    print(trace.fell, trace.base_position[-1], abs(trace.motor_torque).max())

The command line is in `footfall.cli`.
"""

import time
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from footfall.common.errors import UserError
    from footfall.evaluate.api import compare_policies, evaluate_policy
    from footfall.evaluate.config import EvaluationConfig
    from footfall.plant.episode import Episode, Push, run_episode
    from footfall.plant.trace import Trace
    from footfall.policies.policy import Policy, PolicyInput
    from footfall.policies.registry import load_policy
    from footfall.robots.actuator import JointCommand
    from footfall.robots.description import Robot, load_robot
    from footfall.train.api import TrainRequest, export_run
    from footfall.train.api import train as train_policy

__all__ = [
    "Episode",
    "EvaluationConfig",
    "JointCommand",
    "Policy",
    "PolicyInput",
    "Push",
    "Robot",
    "Trace",
    "TrainRequest",
    "UserError",
    "compare_policies",
    "evaluate_policy",
    "export_run",
    "load_policy",
    "load_robot",
    "run_episode",
    "train_policy",
]

IMPORTED_AT_NS = time.time_ns()  # no module of footfall is imported earlier in this process

# `footfall.train` and `footfall.evaluate` are packages, so no function can have these names.
_EXPORTS = {
    "footfall.common.errors": ("UserError",),
    "footfall.evaluate.api": ("compare_policies", "evaluate_policy"),
    "footfall.evaluate.config": ("EvaluationConfig",),
    "footfall.plant.episode": ("Episode", "Push", "run_episode"),
    "footfall.plant.trace": ("Trace",),
    "footfall.policies.policy": ("Policy", "PolicyInput"),
    "footfall.policies.registry": ("load_policy",),
    "footfall.robots.actuator": ("JointCommand",),
    "footfall.robots.description": ("Robot", "load_robot"),
    "footfall.train.api": ("TrainRequest", "export_run"),
}
_MODULES = {name: module for module, names in _EXPORTS.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a name of the API from its module."""
    if name == "train_policy":
        return import_module("footfall.train.api").train
    if name in _MODULES:
        return getattr(import_module(_MODULES[name]), name)
    raise AttributeError(f"module 'footfall' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

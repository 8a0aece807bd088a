"""The contract of the policies that an environment trains."""

from dataclasses import is_dataclass, replace

from footfall.common.config import unstructure
from footfall.envs.config import EnvConfig
from footfall.envs.gait import make_gait
from footfall.policies.contract import Contract, Term
from footfall.policies.observation import term_source
from footfall.robots.description import Robot


def make_contract(robot: Robot, config: EnvConfig) -> Contract:
    """The contract of policies that are trained on this robot with these settings.

    Raises:
        UserError: there is no such gait or observation term, or a term's parameters are wrong.
    """
    terms = tuple(Term(each.term, each.scale, each.history, each.settings) for each in config.observation)
    sources = [term_source(term, f"env.observation[{index}]") for index, term in enumerate(terms)]
    return Contract(
        robot=robot.name,
        digest=robot.digest,
        joints=robot.joint_names,
        control_rate_hz=config.control_rate_hz,
        observation=tuple(map(_with_defaults, terms, sources)),
        default_pose_rad=tuple(robot.default_pose.tolist()),
        action_scale_rad=tuple((config.action_scale * robot.action_scale).tolist()),
        kp=tuple(robot.kp.tolist()),
        kd=tuple(robot.kd.tolist()),
        commands=config.commands.ranges,
        gait=make_gait(robot, config.gait) if config.gait else None,
        standing_command=config.commands.standing_command,
    )


def _with_defaults(term: Term, source: object) -> Term:
    """A term with all parameters written out, if its source is a dataclass: defaults may change later."""
    return replace(term, settings=unstructure(source)) if is_dataclass(source) else term

"""Every term that ships: its kind, its parameters and what it computes."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from footfall.common.terms import Parameter, first_line, parameters
from footfall.domain_rand.distributions import Distribution
from footfall.envs.terms.commands import COMMANDS
from footfall.envs.terms.critic import CRITIC
from footfall.envs.terms.curricula import CURRICULA
from footfall.envs.terms.events import EVENTS
from footfall.envs.terms.rewards import REWARDS
from footfall.envs.terms.terminations import TERMINATIONS
from footfall.policies.observation import TERMS


class TermInfo(NamedTuple):
    """One term of the catalogue."""

    kind: str  # the list of a preset to which it belongs
    name: str
    about: str  # first line of its docstring
    parameters: dict[str, Parameter]


def catalogue() -> list[TermInfo]:
    """The terms that ship, kind by kind."""
    kinds: dict[str, tuple[Mapping[str, Any], Callable[[Any], Any]]] = {
        "rewards": (REWARDS, lambda term: term),
        "observation": (TERMS, lambda term: term.source),
        "critic": (CRITIC, lambda term: term.source),
        "commands": (COMMANDS, lambda term: term.draw),
        "terminations": (TERMINATIONS, lambda term: term),
        "events": (EVENTS, lambda term: term.change),
        "curricula": (CURRICULA, lambda term: term),
    }
    return [
        TermInfo(kind, name, first_line(function(term)), parameters(function(term)))
        for kind, (terms, function) in kinds.items()
        for name, term in terms.items()
    ]


def default_and_limits(parameter: Parameter) -> str:
    """A parameter's default and limits, as text; its unit is the end of its name."""
    default = "required" if parameter.required else _short(parameter.default)
    limits = parameter.limits
    return default if limits is None else f"{default} ({limits.low:g} to {limits.high:g})"


def _short(value: Any) -> str:
    if isinstance(value, Distribution):
        return f"{value.low:g} to {value.high:g}"
    return "none" if value is None else str(value)

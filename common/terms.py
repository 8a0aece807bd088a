"""Terms: functions with typed parameters, listed and configured in YAML.

A term is a function whose keyword-only arguments are its parameters, or a dataclass whose fields are. Types,
defaults and limits come from the signature:

    def track_linear(data, *, sigma_m2_s2: Annotated[float, Between(1e-6, 1e6)] = 0.25): ...

    rewards: [{term: track_linear, weight: 1.5, sigma_m2_s2: 0.25}]
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from inspect import Parameter as Argument
from inspect import signature
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from footfall.common.config import structure_value, takes_other_keys
from footfall.common.errors import UserError
from footfall.common.outside import find, is_import_path, one_line


class Between(NamedTuple):
    """Limits of a number, for `Annotated`; both are allowed values."""

    low: float
    high: float


@takes_other_keys("settings")
@dataclass(frozen=True)
class TermConfig:
    """One entry of a list of terms: the term, and its parameters as in YAML."""

    term: str  # name of a shipped term, or MODULE:NAME
    _: KW_ONLY
    settings: dict[str, Any] = field(default_factory=dict)


@takes_other_keys("settings")
@dataclass(frozen=True)
class NamedTermConfig(TermConfig):
    """An entry with a name that no other entry of its list has."""

    name: str = field(default="", kw_only=True)  # default: the term's own

    @property
    def label(self) -> str:
        """The entry's name: its own, or the term's without its module."""
        return self.name or self.term.rpartition(":")[2]


class Parameter(NamedTuple):
    """A parameter of a term."""

    type: Any
    default: Any  # Argument.empty: required
    limits: Between | None

    @property
    def required(self) -> bool:
        return self.default is Argument.empty


def parameters(term: Callable[..., Any]) -> dict[str, Parameter]:
    """The parameters of a term by name: a function's keyword-only arguments, or all of a class."""
    constructor: Any = vars(term).get("__init__", term) if isinstance(term, type) else term
    hints = get_type_hints(constructor, include_extras=True)
    kinds = (Argument.KEYWORD_ONLY, Argument.POSITIONAL_OR_KEYWORD)
    accepted = kinds if isinstance(term, type) else kinds[:1]
    found = {}
    for name, argument in signature(term).parameters.items():
        if argument.kind in accepted:
            hint = hints.get(name, type(argument.default))
            limits = next((x for x in get_args(hint)[1:] if isinstance(x, Between)), None)
            base = get_args(hint)[0] if get_origin(hint) is Annotated else hint
            found[name] = Parameter(base, argument.default, limits)
    return found


def choose(name: str, available: Mapping[str, Any], what: str, where: str) -> Any:
    """The shipped term with this name, or the object at MODULE:NAME.

    Args:
        name: name in a configuration.
        available: the terms that ship, by name.
        what: the kind of term, for the message: "reward".
        where: the entry, for the message: "env.rewards[2]".

    Raises:
        UserError: there is no such term.
    """
    if name in available:
        return available[name]
    if is_import_path(name):
        return find(name, what)
    raise UserError(f"{where}: no {what} '{name}': there are {', '.join(available)}, or MODULE:NAME")


def bind(term: Any, settings: Mapping[str, Any], where: str) -> Any:
    """A term with its parameters set: an instance of a class, or a partial function.

    Raises:
        UserError: a parameter is unknown, missing or wrong; the message begins with `where` and its name.
    """
    if not callable(term):
        raise UserError(f"{where}: expected a function or a class, not {type(term).__name__}")
    declared = parameters(term)
    unknown = [name for name in settings if name not in declared]
    if unknown:
        available = f"there are {', '.join(declared)}" if declared else "there are none"
        raise UserError(f"{where}.{unknown[0]}: no such parameter ({available})")
    missing = [name for name, each in declared.items() if each.required and name not in settings]
    if missing:
        raise UserError(f"{where}.{missing[0]}: must be given")
    values = {name: _typed(value, declared[name], f"{where}.{name}") for name, value in settings.items()}
    if not isinstance(term, type):
        return partial(term, **values) if values else term
    try:
        return term(**values)
    except ValueError as error:
        raise UserError(f"{where}: {' '.join(str(error).split())}") from None
    except Exception as error:  # any other error is the class's
        raise UserError(f"{where}: {one_line(error)}") from error


def _typed(value: Any, declared: Parameter, where: str) -> Any:
    typed = structure_value(value, declared.type, where)
    limits = declared.limits
    if limits is not None and typed is not None and not limits.low <= typed <= limits.high:
        raise UserError(f"{where}: must be from {limits.low:g} to {limits.high:g}, not {typed:g}")
    return typed


def check_labels(entries: Sequence[NamedTermConfig], where: str) -> None:
    """Raise UserError if two entries have the same name."""
    labels = [entry.label for entry in entries]
    for index, label in enumerate(labels):
        if label in labels[:index]:
            raise UserError(f"{where}[{index}]: there is '{label}' already: give one of them another name")


def first_line(term: Any) -> str:
    """The first line of a term's docstring, empty if it has none."""
    return (getattr(term, "__doc__", None) or "").strip().partition("\n")[0]

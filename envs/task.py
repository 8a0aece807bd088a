"""A task: the terms that a configuration lists, with their parameters, ready to be called.

A term without memory is called with its inputs. A term with memory has two methods instead:

    def init(self, data: StepData) -> Any: ...                  # its state when an episode begins
    def step(self, state: Any, data: StepData) -> tuple[Any, jax.Array]: ...   # the next state, and its value

The states of all terms lie in the environment's `State.terms`, so they are restarted, batched, saved and
divided over devices with the rest of an episode.
"""

from collections.abc import Callable, Sequence
from functools import partial, reduce
from operator import mul
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from footfall.common.errors import UserError
from footfall.common.outside import one_line
from footfall.common.terms import NamedTermConfig, bind, check_labels, choose
from footfall.domain_rand.distributions import Distribution
from footfall.envs.config import EnvConfig, EventConfig
from footfall.envs.terms.commands import COMMANDS, CommandTerm
from footfall.envs.terms.critic import CRITIC, CriticTerm
from footfall.envs.terms.curricula import CURRICULA, linear
from footfall.envs.terms.data import Scene, StepData, example_data
from footfall.envs.terms.events import EVENTS, EventTerm
from footfall.envs.terms.rewards import REWARDS
from footfall.envs.terms.terminations import TERMINATIONS
from footfall.robots.kinds import Kind, Parts

SECTIONS = ("commands", "randomisation")  # sections that a curriculum can act on, besides events


class Terms(NamedTuple):
    """Terms that are evaluated once a control step, by name."""

    by_name: dict[str, Any]

    def init(self, data: StepData) -> dict[str, Any]:
        """The states of the terms that have one, when an episode begins."""
        return {name: term.init(data) for name, term in self.by_name.items() if _has_state(term)}

    def evaluate(self, states: dict[str, Any], data: StepData) -> tuple[dict[str, jax.Array], dict[str, Any]]:
        """The value of each term, and the states after this step."""
        values, next_states = {}, {}
        for name, term in self.by_name.items():
            if name in states:
                next_states[name], values[name] = term.step(states[name], data)
            else:
                values[name] = term(data)
        return values, next_states


class Event(NamedTuple):
    """One event of a task."""

    change: Callable[..., Any]
    numbers: int  # uniform numbers that it takes
    interval_s: Distribution | None  # None: at each reset
    reads_due: bool
    generated_only: bool


class Curriculum(NamedTuple):
    """One curriculum of a task."""

    of: str
    share: Callable[..., jax.Array | float]  # of the level


class Task:
    """The terms of one configuration, for one robot."""

    def __init__(self, config: EnvConfig, scene: Scene) -> None:
        """Raises UserError if a term or a parameter is wrong; the message names the entry."""
        self.rewards = _terms(config.rewards, REWARDS, "reward", "env.rewards")
        self.weights = config.weights
        self.in_full = {name for name, term in self.rewards.by_name.items() if _is_in_full(term)}
        self.terminations = _terms(config.terminations, TERMINATIONS, "termination", "env.terminations")
        self.critic, self.critic_kinds = _critic(config.critic)
        self.command = _command(config)
        self.events = _events(config.events, scene)
        self.curricula = _curricula(config, self.events)
        _check_terms(self.rewards, scene, "env.rewards", 1)
        _check_terms(self.terminations, scene, "env.terminations", 1)
        parts = Parts(len(scene.robot.joint_names), scene.bodies, scene.feet.count)
        _check_terms(self.critic, scene, "env.critic", *(kind.size(parts) for kind in self.critic_kinds))

    def strength(self, of: str, level: jax.Array | float) -> jax.Array | float:
        """The share of the full difficulty that the curricula allow at a level, 0 to 1."""
        shares = [curriculum.share(level) for curriculum in self.curricula if curriculum.of == of]
        # Without a curriculum 1, but computed from the level: XLA would round differently around a constant.
        return reduce(mul, shares) if shares else linear(level, start=1.0)

    def init(self, data: StepData) -> dict[str, dict[str, Any]]:
        """The states of all terms when an episode begins."""
        return {
            "rewards": self.rewards.init(data),
            "terminations": self.terminations.init(data),
            "critic": self.critic.init(data),
        }

    @property
    def resets(self) -> dict[str, Event]:
        """The events of each reset."""
        return {name: event for name, event in self.events.items() if event.interval_s is None}

    @property
    def timed(self) -> dict[str, Event]:
        """The events at random intervals."""
        return {name: event for name, event in self.events.items() if event.interval_s is not None}


def _has_state(term: Any) -> bool:
    return hasattr(term, "init") and hasattr(term, "step")


def _is_in_full(term: Any) -> bool:
    """Whether it is a reward with the decorator `@in_full`, possibly inside a `partial`."""
    return getattr(getattr(term, "func", term), "in_full", False)


def _terms(entries: Sequence[NamedTermConfig], available: dict[str, Any], kind: str, section: str) -> Terms:
    check_labels(entries, section)
    terms = {}
    for index, entry in enumerate(entries):
        key = f"{section}[{index}]"
        terms[entry.label] = bind(choose(entry.term, available, kind, key), entry.settings, key)
    return Terms(terms)


def _critic(entries: Sequence[NamedTermConfig]) -> tuple[Terms, list[Kind]]:
    check_labels(entries, "env.critic")
    terms, kinds = {}, []
    for index, entry in enumerate(entries):
        key = f"env.critic[{index}]"
        term = choose(entry.term, CRITIC, "critic term", key)
        _require(term, CriticTerm, "critic_term", key)
        terms[entry.label] = bind(term.source, entry.settings, key)
        kinds.append(term.kind)
    return Terms(terms), kinds


def _command(config: EnvConfig) -> CommandTerm:
    key = "env.commands"
    term = choose(config.commands.term, COMMANDS, "command term", key)
    _require(term, CommandTerm, "command_term", key)
    return term._replace(draw=bind(term.draw, config.commands.settings, key))


def _events(entries: Sequence[EventConfig], scene: Scene) -> dict[str, Event]:
    check_labels(entries, "env.events")
    parts, events = Parts(len(scene.robot.joint_names), scene.bodies, scene.feet.count), {}
    for index, entry in enumerate(entries):
        key = f"env.events[{index}]"
        term = choose(entry.term, EVENTS, "event", key)
        _require(term, EventTerm, "event_term", key)
        change = bind(term.change, entry.settings, key)
        interval_s = entry.interval_s or term.interval_s
        events[entry.label] = Event(
            change, term.numbers(parts), interval_s, term.reads_due, term.generated_only
        )
    return events


def _curricula(config: EnvConfig, events: dict[str, Event]) -> list[Curriculum]:
    check_labels(config.curricula, "env.curricula")
    curricula = []
    for index, entry in enumerate(config.curricula):
        key = f"env.curricula[{index}]"
        if entry.of not in (*SECTIONS, *events):
            raise UserError(f"{key}.of: no '{entry.of}': there are {', '.join((*SECTIONS, *events))}")
        term = choose(entry.term, CURRICULA, "curriculum", key)
        curricula.append(Curriculum(entry.of, bind(term, entry.settings, key)))
    return curricula


def _require(term: Any, kind: type, decorator: str, key: str) -> None:
    if not isinstance(term, kind):
        raise UserError(f"{key}: expected a function under @{decorator}, not {type(term).__name__}")


def _check_terms(terms: Terms, scene: Scene, section: str, *sizes: int) -> None:
    """Raise UserError if a term fails on a standing robot, or returns a wrong number of values."""
    shapes = jax.eval_shape(partial(_values_when_standing, terms, scene, section))
    for index, name in enumerate(terms.by_name):
        size, expected = shapes[name].size, sizes[index] if index < len(sizes) else 1
        if size != expected:
            raise UserError(f"{section}[{index}]: returns {size} numbers, expected {expected}")


def _values_when_standing(terms: Terms, scene: Scene, section: str) -> dict[str, jax.Array]:
    """Values of all terms for a robot that stands still; an error names the term's entry."""
    example, values = example_data(scene), {}
    for index, (name, term) in enumerate(terms.by_name.items()):
        alone = Terms({name: term})
        try:
            values[name] = jnp.asarray(alone.evaluate(alone.init(example), example)[0][name])
        except UserError as error:
            raise UserError(f"{section}[{index}]: {error}") from None
        except Exception as error:  # any other error is the term's
            raise UserError(f"{section}[{index}]: {one_line(error)}") from error
    return values

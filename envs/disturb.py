"""Commands and events, drawn at a reset and at random intervals."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp

from footfall.domain_rand.distributions import Distribution
from footfall.envs.config import EnvConfig
from footfall.envs.random_numbers import split
from footfall.envs.state import State
from footfall.envs.task import Task
from footfall.envs.terms.data import Scene
from footfall.envs.terms.events import Occasion


class Disturbances:
    """Draws the commands and carries out the events of a task."""

    def __init__(self, task: Task, config: EnvConfig, scene: Scene) -> None:
        self._task, self._config, self._scene = task, config, scene
        self._resets, self._timed = task.resets, task.timed
        # Uniform numbers that `reset` takes, event by event.
        self.reset_numbers = [event.numbers for event in self._resets.values()]
        self.timer_count = 1 + len(self._timed)  # one for the command and one for each timed event
        timed = (event.numbers for event in self._timed.values())
        self._step_sizes = [task.command.numbers, *timed, self.timer_count]
        self.step_numbers = sum(self._step_sizes)  # uniform numbers that `step` takes

    def reset(self, state: State, u_events: Sequence[jax.Array]) -> State:
        """The state after the events of a reset, with uniform numbers for each."""
        for (name, event), u in zip(self._resets.items(), u_events, strict=True):
            occasion = Occasion(self._scene, True, u, self._task.strength(name, state.level))
            state = event.change(state, occasion)
        return state

    def step(self, state: State, u: jax.Array) -> State:
        """The state after the events that are due, with a new command if the old one's time is up.

        Args:
            state: after a control step.
            u: uniform numbers, shape (step_numbers,).
        """
        u_command, *u_events, u_timers = split(u, *self._step_sizes)
        u_hold, *u_intervals = u_timers
        event_steps = {}
        for (name, event), u_event, u_interval in zip(
            self._timed.items(), u_events, u_intervals, strict=True
        ):
            due = state.event_steps[name] <= 0
            occasion = Occasion(self._scene, due, u_event, self._task.strength(name, state.level))
            changed = event.change(state, occasion)
            state = changed if event.reads_due else _where(due, changed, state)
            steps = self._steps(u_interval, event.interval_s)
            event_steps[name] = jnp.where(due, steps, state.event_steps[name] - 1)
        command_due = state.hold_steps <= 0
        return state._replace(
            command=jnp.where(command_due, self.command(u_command, state.level), state.command),
            hold_steps=jnp.where(command_due, self.hold_steps(u_hold), state.hold_steps - 1),
            event_steps=event_steps,
        )

    def command(self, u: jax.Array, level: jax.Array | float) -> jax.Array:
        """A command (3,) from uniform numbers, scaled by the curriculum."""
        return self._task.command.draw(u, self._config.commands) * self._task.strength("commands", level)

    def hold_steps(self, u: jax.Array) -> jax.Array:
        """Control steps for which a command is held, int32, from a uniform number in [0, 1)."""
        return self._steps(u, self._config.commands.hold_s)

    def event_steps(self, u: Sequence[jax.Array]) -> dict[str, jax.Array]:
        """Control steps until each timed event, int32, from a uniform number for each."""
        pairs = zip(self._timed.items(), u, strict=True)
        return {name: self._steps(u_interval, event.interval_s) for (name, event), u_interval in pairs}

    def _steps(self, u: jax.Array, interval_s: Distribution | None) -> jax.Array:
        assert interval_s is not None
        return jnp.int32(interval_s.quantile(u) * self._config.control_rate_hz)


def _where(condition: jax.Array, changed: State, state: State) -> State:
    """The changed state where the condition () holds. Leaves that are the same object are not selected."""
    return jax.tree.map(
        lambda new, old: new if new is old else jnp.where(condition, new, old), changed, state
    )

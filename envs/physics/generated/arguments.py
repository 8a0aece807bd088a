"""Inputs and outputs of a compiled control step, in the order of its arguments."""

from collections.abc import Iterable
from typing import NamedTuple

from footfall.envs.physics.generated.substep import Place, Substep


class Array(NamedTuple):
    """An argument: a row of numbers for each robot, or for each physics step of each robot."""

    name: str
    width: int
    is_stepwise: bool

    def shape(self, robots: int, steps: int) -> tuple[int, ...]:
        """Shape of the array of all robots."""
        return (robots, steps, self.width) if self.is_stepwise else (robots, self.width)


def arguments(substep: Substep) -> tuple[list[Array], list[Array]]:
    """Inputs and outputs. Outputs: the final state, and the trace of each physics step."""
    inputs = [Array(name, width, False) for name, width in (substep.state | substep.fixed_inputs).items()]
    inputs += [Array(name, width, True) for name, width in substep.step_inputs.items()]
    outputs = [Array(f"end.{name}", width, False) for name, width in substep.state.items()]
    outputs += [Array(f"trace.{name}", _width(values), True) for name, values in substep.trace.items()]
    return inputs, outputs


def _width(places: Iterable[Place]) -> int:
    return sum(1 if isinstance(place, int) else len(place) for place in places)

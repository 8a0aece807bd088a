"""Merges the programs of identical limbs: constants and array indices may differ from limb to limb."""

from collections.abc import Iterable, Sequence

import mujoco

from footfall.envs.physics.generated.expression import Expression, Graph, Operand, Scalar
from footfall.envs.physics.generated.limbs import LimbsDifferError, limbs_of
from footfall.envs.physics.generated.substep import Precision, Substep, Values, substep
from footfall.envs.physics.generated.tree import read_tree
from footfall.robots.description import Robot

LEAVES = {"input", "variable", "constant"}  # whose operands are no expressions
PerLimb = tuple[Scalar, ...]  # one value for each limb


def substep_by_threads(
    model: mujoco.MjModel,
    robot: Robot,
    fields: dict[str, tuple[int, ...]],
    precision: Precision,
    effects: tuple[str, ...] = (),
) -> Substep:
    """The same as `substep`, as one program for each limb if the robot's limbs are identical."""
    try:
        parts, partners = limbs_of(model, read_tree(model))
        steps = [substep(model, robot, fields, precision, effects, part) for part in parts]
        results = iter(merged(step.results for step in steps))
    except LimbsDifferError:
        return substep(model, robot, fields, precision, effects)

    def of_limbs(arrays: Sequence[dict[str, Values]]) -> dict[str, Values]:
        places = {name: zip(*(array[name] for array in arrays), strict=True) for name in arrays[0]}
        return {
            name: {place[0] if len(set(place)) == 1 else place: next(results) for place in of_array}
            for name, of_array in places.items()
        }

    following = of_limbs([step.following for step in steps])
    trace = of_limbs([step.trace for step in steps])
    return steps[0]._replace(following=following, trace=trace, limbs=len(parts), partners=tuple(partners))


def merged(outputs: Iterable[Sequence[Scalar]]) -> list[Scalar]:
    """Outputs of the merged program, from the outputs of each limb's program.

    Raises:
        LimbsDifferError: the limbs' programs have different operations.
    """
    programs = list(outputs)
    if len({len(program) for program in programs}) > 1:
        raise LimbsDifferError("limbs differ")
    results = list(zip(*programs, strict=True))
    graph, nodes = Graph(), dict[PerLimb, Scalar]()

    def operand(values: tuple[Operand, ...], operation: str = "") -> Operand:
        if isinstance(values[0], Expression):
            return nodes[values]
        is_serial = operation in {"variable", "loop"} and isinstance(values[0], int)
        if len(set(values)) == 1 or is_serial:
            return values[0]
        return values if operation == "input" else graph.node("lanes", *values)

    for values in _operands_first(results):
        operation = values[0].operation
        operands = [operand(each, operation) for each in zip(*(v.operands for v in values), strict=True)]
        nodes[values] = operands[0] if operation == "constant" else graph.node(operation, *operands)
    return [operand(values) for values in results]


def _operands_first(results: list[PerLimb]) -> list[PerLimb]:
    """All nodes that these nodes need; corresponding nodes of the limbs are side by side."""
    needed, waiting = set[PerLimb](), list(results)
    while waiting:
        values = waiting.pop()
        if values in needed or not any(isinstance(value, Expression) for value in values):
            continue
        if len({_kind(value) for value in values}) > 1:
            raise LimbsDifferError("limbs differ")
        needed.add(values)
        if values[0].operation not in LEAVES:
            waiting.extend(zip(*(value.operands for value in values), strict=True))
    return sorted(needed, key=lambda values: [value.number for value in values])


def _kind(value: Scalar) -> tuple[str, int]:
    return (value.operation, len(value.operands)) if isinstance(value, Expression) else ("number", 0)

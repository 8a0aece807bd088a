"""Scalar expressions: arithmetic on them records a straight-line program instead of computing.

An expression stands for one number of one robot. Constants stay Python floats and are folded, equal
expressions are one node, so that a model's zeros and a robot's symmetries cost nothing. Arrays of expressions
are NumPy arrays of type object: `@`, slices and sums on them work as on numbers.
"""

import math
from collections.abc import Callable, Collection, Iterable
from typing import Any, NamedTuple

import numpy as np

Scalar = Any  # an Expression or a float
Operand = Any  # an Expression, a float, or a part of an input's name


LoopBody = Callable[[list[Scalar]], tuple[list[Scalar], Scalar]]


class Graph:
    """Nodes of one program. Operands come before the nodes that use them."""

    def __init__(self) -> None:
        self._nodes: dict[tuple, Expression] = {}

    def node(self, operation: str, *operands: Operand) -> "Expression":
        """The node of this operation; equal operations share one."""
        key = (operation, *(o.number if isinstance(o, Expression) else o for o in operands))
        if key not in self._nodes:
            self._nodes[key] = Expression(self, len(self._nodes), operation, operands)
        return self._nodes[key]

    def input(self, array: str, index: int) -> "Expression":
        """An element of an input array."""
        return self.node("input", array, index)

    def inputs(self, array: str, *shape: int) -> np.ndarray:
        """All elements of an input array, of this shape."""
        elements = np.empty(math.prod(shape), object)
        elements[:] = [self.input(array, index) for index in range(elements.size)]
        return elements.reshape(shape)

    def repeat(self, max_repetitions: int, start: list[Scalar], body: LoopBody) -> list[Scalar]:
        """The values after repeating `body`, from `start`.

        Args:
            max_repetitions: the loop ends after this number, even if the flag is true.
            start: the initial values.
            body: returns the next values, and a flag that is true to continue.
        """
        serial = len(self._nodes)
        following, continues = body([self.node("variable", serial, k) for k in range(len(start))])
        loop = self.node("loop", serial, max_repetitions, continues, *start, *following)
        return [self.node("result", loop, k) for k in range(len(start))]


def _are_constants(one: Scalar, other: Scalar = 0.0) -> bool:
    return not (isinstance(one, Expression) or isinstance(other, Expression))


def _node(operation: str, *operands: Operand) -> Scalar:
    graph = next(operand.graph for operand in operands if isinstance(operand, Expression))
    return graph.node(operation, *(o if isinstance(o, Expression) else float(o) for o in operands))


def _is(value: Scalar, operation: str) -> bool:
    return isinstance(value, Expression) and value.operation == operation


def _ordered(a: Scalar, b: Scalar) -> tuple[Scalar, Scalar]:
    """Operands whose order does not matter: the older one first, a constant last."""
    if _are_constants(a) or (not _are_constants(b) and a.number > b.number):
        return b, a
    return a, b


def add(a: Scalar, b: Scalar) -> Scalar:
    if _are_constants(a, b):
        return a + b
    for one, other in ((a, b), (b, a)):
        if _are_constants(one) and one == 0.0:
            return other
        if _is(other, "negative"):
            return subtract(one, other.operands[0])
    return _node("add", *_ordered(a, b))


def subtract(a: Scalar, b: Scalar) -> Scalar:
    if _are_constants(a, b):
        return a - b
    if _are_constants(b) and b == 0.0:
        return a
    if _are_constants(a) and a == 0.0:
        return negative(b)
    if _is(b, "negative"):
        return add(a, b.operands[0])
    return 0.0 if a is b else _node("subtract", a, b)


def negative(a: Scalar) -> Scalar:
    if _are_constants(a):
        return -a
    if _is(a, "negative"):
        return a.operands[0]
    return subtract(*reversed(a.operands)) if _is(a, "subtract") else _node("negative", a)


def multiply(a: Scalar, b: Scalar) -> Scalar:
    if _are_constants(a, b):
        return a * b
    for one, other in ((a, b), (b, a)):
        if _are_constants(one):
            if one == 0.0:
                return 0.0
            if one == 1.0:
                return other
            if one == -1.0:
                return negative(other)
            if _is(other, "multiply") and _are_constants(other.operands[1]):
                return multiply(other.operands[0], one * other.operands[1])
        if _is(one, "negative"):
            return negative(multiply(one.operands[0], other))
    return _node("multiply", *_ordered(a, b))


def divide(a: Scalar, b: Scalar) -> Scalar:
    if _are_constants(b):
        return multiply(a, 1.0 / b)
    return 0.0 if _are_constants(a) and a == 0.0 else _node("divide", a, b)


def minimum(a: Scalar, b: Scalar) -> Scalar:
    return min(a, b) if _are_constants(a, b) else _node("minimum", a, b)


def maximum(a: Scalar, b: Scalar) -> Scalar:
    return max(a, b) if _are_constants(a, b) else _node("maximum", a, b)


def less(a: Scalar, b: Scalar) -> Scalar:
    return a < b if _are_constants(a, b) else _node("less", a, b)


def _either(a: Scalar, b: Scalar) -> Scalar:
    return (a or b) if _are_constants(a, b) else _node("either", a, b)


def where(condition: Scalar, yes: Scalar, no: Scalar) -> Scalar:
    """`yes` where the condition holds, else `no`."""
    if _are_constants(condition):
        return yes if condition else no
    if yes is no or (_are_constants(yes, no) and yes == no):
        return yes
    return condition.graph.node(
        "where", condition, *(v if not _are_constants(v) else float(v) for v in (yes, no))
    )


def _function(name: str, of_a_constant: Callable[[float], float]) -> Callable[[Scalar], Scalar]:
    return lambda value: of_a_constant(value) if _are_constants(value) else _node(name, value)


sqrt = _function("sqrt", math.sqrt)
absolute = _function("abs", abs)
round_to_integer = _function("round", round)
sin = _function("sin", math.sin)
cos = _function("cos", math.cos)


Binary = Callable[[Scalar, Scalar], Scalar]


def _operators(function: Binary) -> tuple[Binary, Binary]:
    """An operator's two methods, from the left and from the right. Arrays take their elements one by one."""

    def left(self: Scalar, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else function(self, other)

    def right(self: Scalar, other: Scalar) -> Scalar:
        return NotImplemented if isinstance(other, np.ndarray) else function(other, self)

    return left, right


class Expression:
    """A number that the program computes. Implements the part of the array API that the joint law uses."""

    __slots__ = ("graph", "number", "operands", "operation")

    def __init__(self, graph: Graph, number: int, operation: str, operands: tuple[Operand, ...]) -> None:
        self.graph, self.number, self.operation, self.operands = graph, number, operation, operands

    def __array_namespace__(self) -> Any:
        return Namespace

    __add__, __radd__ = _operators(add)
    __sub__, __rsub__ = _operators(subtract)
    __mul__, __rmul__ = _operators(multiply)
    __truediv__, __rtruediv__ = _operators(divide)
    __lt__, __gt__ = _operators(less)
    __or__, __ror__ = _operators(_either)

    def __neg__(self) -> Scalar:
        return negative(self)

    def __bool__(self) -> bool:
        raise TypeError("an expression has no value yet: use `where`")

    def clip(self, lower: Scalar, upper: Scalar) -> Scalar:
        return minimum(maximum(self, lower), upper)


class Namespace:
    """Result of `__array_namespace__`: array functions, so that the joint law is written once."""

    minimum = staticmethod(minimum)
    maximum = staticmethod(maximum)
    where = staticmethod(where)
    abs = staticmethod(absolute)


class Loop(NamedTuple):
    """Operands of a "loop" node."""

    variables: list[Expression | None]  # None: the body does not read it
    start: list[Scalar]
    following: list[Scalar]
    continues: Scalar  # flag computed by the body: true to continue
    max_repetitions: int
    body: list[Expression]  # operands first


class Schedule(NamedTuple):
    """The nodes of a program in the order in which they were recorded: operands first."""

    before_steps: list[Expression]  # nodes that depend on fixed inputs alone: computed once
    step: list[Expression]  # computed in each physics step
    loops: dict[Expression, Loop]  # whose bodies are in neither list


def schedule(outputs: Iterable[Scalar], fixed_inputs: Collection[str]) -> Schedule:
    """The nodes that a program with these outputs must compute.

    Args:
        outputs: outputs of one physics step.
        fixed_inputs: names of the input arrays that do not change from step to step.
    """
    needed: dict[int, Expression] = {}
    waiting = [output for output in outputs if isinstance(output, Expression)]
    while waiting:
        node = waiting.pop()
        if node.number not in needed:
            needed[node.number] = node
            waiting.extend(operand for operand in node.operands if isinstance(operand, Expression))
    before_steps, step, loops = [], [], {}
    bodies: dict[Expression, int] = {}  # nodes in a loop's body, with its serial number
    changing: set[Expression] = set()
    for _, node in sorted(needed.items()):
        operands = [operand for operand in node.operands if isinstance(operand, Expression)]
        loop_serials = {bodies[operand] for operand in operands if operand in bodies}
        if node.operation == "variable":
            bodies[node] = node.operands[0]
        elif node.operation == "loop":
            loops[node] = _loop(node, bodies)
            step.append(node)
            changing.add(node)
        elif loop_serials:
            (bodies[node],) = loop_serials
        elif changing.intersection(operands) or (
            node.operation == "input" and node.operands[0] not in fixed_inputs
        ):
            step.append(node)
            changing.add(node)
        else:
            before_steps.append(node)
    return Schedule(before_steps, step, loops)


def _loop(node: Expression, bodies: dict[Expression, int]) -> Loop:
    serial, max_repetitions, continues, *values = node.operands
    count = len(values) // 2
    body = [each for each, loop_serial in bodies.items() if loop_serial == serial]
    variables: list[Expression | None] = [None] * count
    for each in body:
        if each.operation == "variable":
            variables[each.operands[1]] = each
    rest = [each for each in body if each.operation != "variable"]
    return Loop(variables, values[:count], values[count:], continues, max_repetitions, rest)

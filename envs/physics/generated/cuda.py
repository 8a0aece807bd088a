"""A physics step as a CUDA kernel: one thread a robot, all arrays with the robots side by side in memory."""

from typing import Any

import numpy as np

from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.expression import Expression, Loop, Scalar, schedule
from footfall.envs.physics.generated.substep import Substep

NAME = "control_step"
OPERATIONS = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "negative": "-{}",
    "minimum": "fminf({}, {})",
    "maximum": "fmaxf({}, {})",
    "abs": "fabsf({})",
    "sqrt": "sqrtf({})",
    "round": "rintf({})",
    "sin": "sinf({})",
    "cos": "cosf({})",
    "less": "{} < {}",
    "either": "{} || {}",
    "where": "{} ? {} : {}",
}
FLAGS = {"less", "either"}  # operations whose result is a bool


def kernel_source(substep: Substep, steps: int, robots: int, block: int, blocks: int) -> str:
    """The kernel's text. Its arguments are pointers to inputs and outputs, as `arguments` lists them.

    Args:
        substep: one physics step.
        steps: physics steps in a control step.
        robots: number of robots.
        block: threads in a block.
        blocks: blocks that must fit on a multiprocessor at once; bounds the registers of a thread.
    """
    inputs, outputs = arguments(substep)
    names = {array.name: array.name.replace(".", "_") for array in (*inputs, *outputs)}
    widths = {array.name: array.width for array in (*inputs, *outputs)}

    def element(array: str, index: int, stepwise: bool) -> str:
        row = f"(step * {widths[array]} + {index})" if stepwise else str(index)
        return f"{names[array]}[{row} * {robots} + robot]"

    def of(value: Scalar) -> str:
        if isinstance(value, Expression):
            return f"n{value.number}"
        return f"{float(np.float32(value))!r}f"

    def lines(node: Expression) -> list[str]:
        match node.operation:
            case "input":
                array, index = node.operands
                if array in substep.state:
                    return [f"const float n{node.number} = {names[array]}_{index};"]
                return [f"const float n{node.number} = {element(array, index, array in substep.stepwise)};"]
            case "result":
                return [f"const float n{node.number} = n{node.operands[0].number}_{node.operands[1]};"]
            case "loop":
                return loop(f"n{node.number}", plan.loops[node])
        kind = "bool" if node.operation in FLAGS else "float"
        computed = OPERATIONS[node.operation].format(*map(of, node.operands))
        return [f"const {kind} n{node.number} = {computed};"]

    def loop(name: str, loop: Loop) -> list[str]:
        numbers = range(len(loop.start))
        read = [(k, variable) for k, variable in enumerate(loop.variables) if variable is not None]
        return [
            *(f"float {name}_{k} = {of(loop.start[k])};" for k in numbers),
            "#pragma unroll 1",
            f"for (int turn = 0; turn < {loop.max_repetitions}; turn++) {{",
            *(f"const float n{variable.number} = {name}_{k};" for k, variable in read),
            *(line for node in loop.body for line in lines(node)),
            *(f"{name}_{k} = {of(loop.following[k])};" for k in numbers),
            f"if (!{of(loop.more)}) break;",
            "}",
        ]

    results = [v for part in (substep.following, substep.trace) for array in part.values() for v in array]
    plan = schedule(results, substep.held)
    state = [(name, index) for name, width in substep.state.items() for index in range(width)]
    pointers = [f"const float* __restrict__ {names[array.name]}" for array in inputs]
    pointers += [f"float* __restrict__ {names[array.name]}" for array in outputs]
    text = [
        f'extern "C" __global__ void __launch_bounds__({block}, {blocks}) {NAME}({", ".join(pointers)}) {{',
        "const int robot = blockIdx.x * blockDim.x + threadIdx.x;",
        f"if (robot >= {robots}) return;",
        *(f"float {names[name]}_{index} = {element(name, index, False)};" for name, index in state),
        *(line for node in plan.before for line in lines(node)),
        "#pragma unroll 1",
        f"for (int step = 0; step < {steps}; step++) {{",
        *(line for node in plan.step for line in lines(node)),
        *(
            f"{element(f'trace.{name}', index, True)} = {of(value)};"
            for name, values in substep.trace.items()
            for index, value in enumerate(values)
        ),
        *(f"{names[name]}_{index} = {of(substep.following[name][index])};" for name, index in state),
        "}",
        *(f"{element(f'end.{name}', index, False)} = {names[name]}_{index};" for name, index in state),
        "}",
    ]
    return "\n".join(text) + "\n"


def layout(array: Any) -> tuple[int, ...]:
    """Axes of an array (robots, ...) from the slowest to the fastest in memory: robots side by side."""
    return (*range(1, array.ndim), 0)

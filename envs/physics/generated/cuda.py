"""A physics step as a CUDA kernel: one thread a robot, or one a limb; robots lie side by side in memory."""

from typing import Any

import numpy as np

from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.expression import Expression, Loop, Scalar, schedule
from footfall.envs.physics.generated.substep import Place, Substep

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
ALL_LANES = "0xffffffffu"  # lanes of a warp


def lanes_of(substep: Substep) -> int:
    """Threads of a robot: its limbs, and idle ones up to a power of two, which divides a warp."""
    return 1 << (substep.limbs - 1).bit_length()


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
    lanes = lanes_of(substep)
    bits = lanes.bit_length() - 1

    def of_limb(values: list[str]) -> str:
        """One of these values, by the limb."""
        first, *rest = values
        for limb, value in enumerate(rest, 1):
            first = f"limb == {limb} ? {value} : {first}"
        return f"({first})"

    def index(place: Place) -> str:
        return str(place) if isinstance(place, int) else of_limb([str(each) for each in place])

    def element(array: str, place: Place, is_stepwise: bool) -> str:
        row = f"(step * {widths[array]} + {index(place)})" if is_stepwise else index(place)
        return f"{names[array]}[{row} * {robots} + robot]"

    def text_of(value: Scalar) -> str:
        if isinstance(value, Expression):
            return f"n{value.number}"
        return f"{float(np.float32(value))!r}f"

    def lines(node: Expression) -> list[str]:
        name = f"n{node.number}"
        match node.operation:
            case "input":
                array, place = node.operands
                if array in substep.state:
                    return [f"const float {name} = {state[array, place]};"]
                return [f"const float {name} = {element(array, place, array in substep.step_inputs)};"]
            case "result":
                return [f"const float {name} = n{node.operands[0].number}_{node.operands[1]};"]
            case "loop":
                return loop(name, plan.loops[node])
            case "lanes":
                return [f"const float {name} = {of_limb([text_of(value) for value in node.operands])};"]
            case "total":
                (value,) = map(text_of, node.operands)
                summand = value if lanes == substep.limbs else f"idle ? 0.0f : {value}"
                # The same tree of sums in each lane: all have the same bits.
                added = (f"{name} += __shfl_xor_sync({ALL_LANES}, {name}, {1 << k});" for k in range(bits))
                return [f"float {name} = {summand};", *added]
            case "partner":
                value, slot = node.operands
                partner = of_limb([str(limb) for limb in substep.partners[slot]])
                return [
                    f"const float {name} = __shfl_sync({ALL_LANES}, {text_of(value)}, {partner}, {lanes});"
                ]
        kind = "bool" if node.operation in FLAGS else "float"
        computed = OPERATIONS[node.operation].format(*map(text_of, node.operands))
        return [f"const {kind} {name} = {computed};"]

    def loop(name: str, loop: Loop) -> list[str]:
        """All threads of a warp repeat until the last one has finished; those that have keep their values."""
        numbers = range(len(loop.start))
        read = [(k, variable) for k, variable in enumerate(loop.variables) if variable is not None]
        return [
            *(f"float {name}_{k} = {text_of(loop.start[k])};" for k in numbers),
            f"bool {name}_more = true;",
            "#pragma unroll 1",
            f"for (int turn = 0; turn < {loop.max_repetitions}; turn++) {{",
            *(f"const float n{variable.number} = {name}_{k};" for k, variable in read),
            *(line for node in loop.body for line in lines(node)),
            *(f"{name}_{k} = {name}_more ? {text_of(loop.following[k])} : {name}_{k};" for k in numbers),
            f"{name}_more = {name}_more && {text_of(loop.continues)};",
            f"if (!{f'__any_sync({ALL_LANES}, {name}_more)' if lanes > 1 else f'{name}_more'}) break;",
            "}",
        ]

    plan = schedule(substep.results, substep.fixed_inputs)
    state = {
        (array, place): f"{names[array]}_{k}"
        for array, values in substep.following.items()
        for k, place in enumerate(values)
    }
    pointers = [f"const float* __restrict__ {names[array.name]}" for array in inputs]
    pointers += [f"float* __restrict__ {names[array.name]}" for array in outputs]
    text = [
        f'extern "C" __global__ void __launch_bounds__({block}, {blocks}) {NAME}({", ".join(pointers)}) {{',
        "const int thread = blockIdx.x * blockDim.x + threadIdx.x;",
        # Idle threads compute, too, because all threads of a warp exchange values.
        f"const bool idle = thread % {lanes} >= {substep.limbs}, beyond = thread >= {robots * lanes};",
        f"const int robot = beyond ? {robots - 1} : thread / {lanes}, limb = idle ? 0 : thread % {lanes};",
        *(f"float {name} = {element(*key, False)};" for key, name in state.items()),
        *(line for node in plan.before_steps for line in lines(node)),
        "#pragma unroll 1",
        f"for (int step = 0; step < {steps}; step++) {{",
        *(line for node in plan.step for line in lines(node)),
        "if (!idle && !beyond) {",
        *(
            f"{element(f'trace.{name}', place, True)} = {text_of(value)};"
            for name, values in substep.trace.items()
            for place, value in values.items()
        ),
        "}",
        *(f"{name} = {text_of(substep.following[array][place])};" for (array, place), name in state.items()),
        "}",
        "if (!idle && !beyond) {",
        *(f"{element(f'end.{array}', place, False)} = {name};" for (array, place), name in state.items()),
        "}",
        "}",
    ]
    return "\n".join(text) + "\n"


def layout(array: Any) -> tuple[int, ...]:
    """Axes of an array (robots, ...) from the slowest to the fastest in memory: robots side by side."""
    return (*range(1, array.ndim), 0)

"""The generated machine code inside a JAX program, on all of a processor's cores."""

import importlib.util
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.buffer_callback import buffer_callback

from footfall.common.installation import install_extras
from footfall.common.processors import usable_cores
from footfall.envs.physics.generated.arguments import arguments

if TYPE_CHECKING:
    from footfall.envs.physics.generated.llvm import Program

LEAST_SHARE = 32  # robots that are worth a thread


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(usable_cores(), thread_name_prefix="physics")


def unavailable() -> str:
    """Why nothing can be compiled here; empty if it can."""
    if importlib.util.find_spec("llvmlite") is None:
        return f"llvmlite, which compiles it, is not installed: {install_extras('train')}"
    return ""


@cache
def _program(substep_of: Any, steps: int) -> "Program":
    from footfall.envs.physics.generated.llvm import Program  # llvmlite may be missing

    return Program(substep_of(), steps)


def run(substep_of: Any, steps: int, robots: int, arrays: list[jax.Array]) -> list[jax.Array]:
    """A control step of all robots. For the arguments see `on_gpu.run`."""
    program = _program(substep_of, steps)
    _, outputs = arguments(substep_of())
    shapes = [jax.ShapeDtypeStruct(array.shape(robots, steps), jnp.float32) for array in outputs]
    parts = max(1, min(usable_cores(), robots // LEAST_SHARE))
    bounds = [robots * part // parts for part in range(parts + 1)]

    def control_step(_: Any, results: list[Any], *given: Any) -> None:
        memory = [np.asarray(array) for array in (*given, *results)]  # where XLA's arrays lie
        shares = [_threads().submit(program, memory, *share) for share in pairwise(bounds[1:])]
        program(memory, *bounds[:2])
        for share in shares:
            share.result()

    return buffer_callback(control_step, shapes)(*arrays)

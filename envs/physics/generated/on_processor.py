"""The generated machine code inside a JAX program, on all CPU cores.

A program names the code by its content, so that JAX finds the compiled program again in another process.
"""

import hashlib
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib import import_module
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from footfall.common.installation import extras_command
from footfall.common.outside import one_line
from footfall.common.processors import usable_cores
from footfall.envs.physics.generated import handler
from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.handler import Launch

if TYPE_CHECKING:
    from footfall.envs.physics.generated.llvm import Program

MIN_ROBOTS_PER_THREAD = 32  # with fewer, a thread costs more than it gains


@cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(usable_cores(), thread_name_prefix="physics")


def unavailable() -> str:
    """Reason why the code cannot be compiled here; empty if it can."""
    try:
        import_module("llvmlite.binding")
    except (ImportError, OSError) as error:  # not installed, or its library does not load here
        return f"llvmlite, which compiles it, does not load ({one_line(error)}): {extras_command('train')}"
    if handler.version()[0] != handler.KNOWN_MAJOR:
        return f"this jaxlib calls foreign functions by version {handler.version()[0]} of XLA's interface"
    return ""


@cache
def _program(substep_of: Any, steps: int) -> "Program":
    from footfall.envs.physics.generated.llvm import Program  # llvmlite may be missing

    return Program(substep_of(), steps)


_functions: dict[str, tuple[object, ...]] = {}  # objects that keep the registered functions alive, by name


@cache
def _function(substep_of: Any, steps: int, robots: int) -> str:
    """Register the function that steps this number of robots; returns its name."""
    program = _program(substep_of, steps)
    name = f"footfall_step_{hashlib.sha256(program.text.encode()).hexdigest()[:16]}_{robots}"
    if name in _functions:
        return name
    parts = max(1, min(usable_cores(), robots // MIN_ROBOTS_PER_THREAD))
    bounds = [robots * part // parts for part in range(parts + 1)]
    inputs, outputs = arguments(substep_of())
    count = len(inputs) + len(outputs)

    def launch(*launch_arguments: Any) -> int:
        """Returns 0, or 1 on failure, which XLA reports as an error."""
        try:
            parameters = launch_arguments[-2]
            pointers = [parameters[k][0] for k in range(count)]
            futures = [_threads().submit(program.move, pointers, *part) for part in pairwise(bounds[1:])]
            program.move(pointers, *bounds[:2])
            for future in futures:
                future.result()
        except Exception:
            return 1
        return 0

    launcher = handler.LAUNCHER(launch)
    engine, address = handler.compiled(
        Launch(len(inputs), len(outputs), parts, 1), handler.address_of(launcher), on_stream=False
    )
    jax.ffi.register_ffi_target(name, handler.capsule(address), platform="cpu")
    _functions[name] = (launcher, engine)
    return name


def run(substep_of: Any, steps: int, robots: int, arrays: list[jax.Array]) -> list[jax.Array]:
    """A control step of all robots; arguments as for `on_gpu.run`."""
    _, outputs = arguments(substep_of())
    shapes = [jax.ShapeDtypeStruct(array.shape(robots, steps), jnp.float32) for array in outputs]
    return list(jax.ffi.ffi_call(_function(substep_of, steps, robots), shapes)(*arrays))

"""The generated kernel inside a JAX program, on NVIDIA's GPUs.

NVIDIA's run-time compiler compiles it and the driver loads it, both by ctypes. JAX's programs
call it as a foreign function (`handler.py`), by the public interface
https://docs.jax.dev/en/latest/ffi.html: no compiler is needed on the user's machine.
"""

import hashlib
import importlib.util
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp

from footfall.common.installation import extras_command
from footfall.envs.physics.generated import driver, handler, kernels, nvrtc
from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.cuda import kernel_source, lanes_of, layout
from footfall.envs.physics.generated.handler import Launch

MIN_CAPABILITY = 80  # Ampere
THREADS, BLOCKS = 128, 2  # per block; blocks per multiprocessor: docs/journal.md compares other values


def unavailable() -> str:
    """Why a kernel cannot be called here; empty if it can."""
    if importlib.util.find_spec("llvmlite") is None:
        return f"llvmlite, which compiles its call, is not installed: {extras_command('train')}"
    if handler.version()[0] != handler.KNOWN_MAJOR:
        return f"this jaxlib calls foreign functions by version {handler.version()[0]} of XLA's interface"
    try:
        nvrtc.library()
        capability = driver.capability()
    except (nvrtc.NvrtcError, driver.DriverError) as error:
        return str(error)
    if capability < MIN_CAPABILITY:
        return f"the GPU's compute capability, {capability / 10:g}, is below {MIN_CAPABILITY / 10:g}"
    return ""


@lru_cache(maxsize=16)
def _kernel(substep_of: Any, steps: int, robots: int) -> str:
    """Register the kernel for this number of robots; returns its name."""
    inputs, outputs = arguments(substep_of())
    threads = robots * lanes_of(substep_of())
    source = kernel_source(substep_of(), steps, robots, THREADS, BLOCKS)
    capability = driver.capability()
    digest = hashlib.sha256(f"{capability} {source}".encode()).hexdigest()
    name = f"footfall_control_step_{digest[:16]}"
    launch = Launch(len(inputs), len(outputs), -(-threads // THREADS), THREADS)
    compile_now = robots > 1  # one robot is traced for its shapes, and the kernel is seldom called
    kernels.register(name, launch, lambda: nvrtc.compile_to_cubin(source, capability), compile_now)
    return name


def run(substep_of: Any, steps: int, robots: int, arrays: list[jax.Array]) -> list[jax.Array]:
    """A control step of all robots.

    Args:
        substep_of: returns the physics step; a cache key, so the same object for the same step.
        steps: physics steps in a control step.
        robots: number of robots.
        arrays: the inputs, as `arguments` lists them.
    """
    _, outputs = arguments(substep_of())
    shapes = [jax.ShapeDtypeStruct(array.shape(robots, steps), jnp.float32) for array in outputs]
    call = jax.ffi.ffi_call(
        _kernel(substep_of, steps, robots),
        shapes,
        input_layouts=[layout(a) for a in arrays],
        output_layouts=[layout(s) for s in shapes],
    )
    return list(call(*arrays))

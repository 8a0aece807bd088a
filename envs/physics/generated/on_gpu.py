"""The generated kernel inside a JAX program, on NVIDIA's GPUs.

Reason: JAX has no public way to call a kernel that is given as PTX. jaxlib's own call of Triton's kernels
takes any PTX; it is internal, and `unavailable` says when a release lacks it.
Upstream: the public way, https://docs.jax.dev/en/latest/ffi.html, needs a compiler on the user's machine.
It can go when JAX calls a kernel from PTX: tests/envs/test_generated_gpu.py says what is used of it.
"""

import zlib
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp

from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.cuda import NAME, kernel_source, layout
from footfall.envs.physics.generated.nvrtc import NvrtcError, compile_to_ptx, library
from footfall.envs.physics.generated.substep import Substep

TARGET = "triton_kernel_call_ffi"
LEAST_CAPABILITY = 80  # Ampere
THREADS, BLOCKS = 64, 4  # in a block; of them on a multiprocessor: docs/results.md#physics compares others
ALIGNMENT = 16  # bytes, of XLA's arrays


def unavailable() -> str:
    """Why a kernel cannot be called here; empty if it can."""
    try:
        from jaxlib import gpu_triton

        needed = (gpu_triton.TritonKernel, gpu_triton.TritonKernelCall, gpu_triton.create_array_parameter)
        capability = gpu_triton.get_compute_capability(0)
        library()
    except (ImportError, AttributeError) as error:
        return f"this release of jaxlib does not call kernels from PTX ({error})"
    except NvrtcError as error:
        return str(error)
    if not all(map(callable, needed)) or capability < LEAST_CAPABILITY:
        return f"the GPU's compute capability, {capability / 10:g}, is below {LEAST_CAPABILITY / 10:g}"
    return ""


@lru_cache(maxsize=16)
def _call(substep_of: Any, steps: int, robots: int) -> bytes:
    """The serialised call of the kernel for so many robots."""
    from jaxlib import gpu_triton

    substep: Substep = substep_of()
    capability = gpu_triton.get_compute_capability(0)
    ptx = compile_to_ptx(kernel_source(substep, steps, robots, THREADS, BLOCKS), capability)
    kernel = gpu_triton.TritonKernel(NAME, THREADS // 32, 1, 0, ptx, "", capability)
    inputs, outputs = arguments(substep)
    parameters = [gpu_triton.create_array_parameter(0, ALIGNMENT)] * len((*inputs, *outputs))
    call = gpu_triton.TritonKernelCall(kernel, -(-robots // THREADS), 1, 1, parameters)
    return zlib.compress(call.to_proto(NAME, b""))


def run(substep_of: Any, steps: int, robots: int, arrays: list[jax.Array]) -> list[jax.Array]:
    """A control step of all robots.

    Args:
        substep_of: gives the physics step; the same object for the same step.
        steps: physics steps in it.
        robots: their number.
        arrays: of each input, as `arguments` lists them.
    """
    _, outputs = arguments(substep_of())
    shapes = [jax.ShapeDtypeStruct(array.shape(robots, steps), jnp.float32) for array in outputs]
    call = jax.ffi.ffi_call(
        TARGET, shapes, input_layouts=[layout(a) for a in arrays], output_layouts=[layout(s) for s in shapes]
    )
    return list(call(*arrays, name=NAME, opaque=_call(substep_of, steps, robots)))

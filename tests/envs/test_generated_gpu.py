"""The kernel for GPUs computes the same as the program for processors, and how XLA launches it."""

import ctypes
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import repeat
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from made_up import BIPED, FIVE, SOLES
from physics_parity import STEPS, random_arguments

from footfall.envs.physics.generated import driver, handler, kernels, nvrtc, on_gpu
from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.cuda import NAME, kernel_source, lanes_of
from footfall.envs.physics.generated.driver import DriverError
from footfall.envs.physics.generated.handler import LAUNCHER, Launch
from footfall.envs.physics.generated.limb_program import substep_by_threads
from footfall.envs.physics.generated.llvm import Program
from footfall.envs.physics.generated.nvrtc import NvrtcError
from footfall.envs.physics.generated.substep import SINGLE, substep
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import training_model
from footfall.train.config import load_preset

COMPILER = shutil.which("c++") or shutil.which("g++")
ROBOTS, BLOCK = 37, 64  # the last block is not full
# Parts of CUDA's C that C++ lacks. The threads of a warp take turns: each runs until it exchanges a value.
PRELUDE = """#include <cmath>
#include <ucontext.h>
#define __global__
#define __restrict__
#define __launch_bounds__(threads, blocks)
struct Index { int x; } blockIdx, blockDim, threadIdx;
const int WARP = 32, STACK = 1 << 20;
static ucontext_t turns, threads[WARP];
static int current, exchanges[WARP];
static float given[2][WARP];
static float* exchange(float value) {
  float* values = given[exchanges[current]++ % 2];
  values[current] = value;
  swapcontext(&threads[current], &turns);
  return values;
}
static float __shfl_xor_sync(unsigned, float value, int lane) { return exchange(value)[current ^ lane]; }
static float __shfl_sync(unsigned, float value, int lane, int width) {
  return exchange(value)[current / width * width + lane];
}
static bool __any_sync(unsigned, bool value) {
  const float* values = exchange(value);
  for (int k = 0; k < WARP; k++) if (values[k]) return true;
  return false;
}
"""
EPILOGUE = """
static float** a;
static bool alive[WARP];
static void thread() { NAME(ARGUMENTS); alive[current] = false; }
extern "C" void all(int blocks, int size, float** arrays) {
  static char stacks[WARP][STACK];
  a = arrays, blockDim.x = size;
  for (blockIdx.x = 0; blockIdx.x < blocks; blockIdx.x++)
    for (int first = 0; first < size; first += WARP) {
      for (current = 0; current < WARP; current++) {
        getcontext(&threads[current]);
        threads[current].uc_stack.ss_sp = stacks[current], threads[current].uc_stack.ss_size = STACK;
        threads[current].uc_link = &turns, alive[current] = true, exchanges[current] = 0;
        makecontext(&threads[current], thread, 0);
      }
      for (bool any = true; any;) {
        any = false;
        for (current = 0; current < WARP; current++)
          if (alive[current]) {
            threadIdx.x = first + current, any = true;
            swapcontext(&turns, &threads[current]);
          }
      }
    }
}
"""


@pytest.mark.skipif(COMPILER is None, reason="needs a C++ compiler")
@pytest.mark.parametrize(
    ("name", "write", "exact"),
    [("go1", substep, False), ("go1", substep_by_threads, True), ("hexapod", substep_by_threads, False)],
)
def test_the_kernel_equals_the_processors_program(name: str, write: Any, exact: bool, tmp_path: Path) -> None:
    robot = load_robot(name)
    model = training_model(robot, exact_friction=exact)
    given = random_arguments(robot, model, ROBOTS, load_preset("gpu", robot).env.randomisation)
    hips = given["qpos"][::2, 7::3]  # anywhere in their range, so that legs meet
    hips[:] = np.random.default_rng(0).uniform(*model.jnt_range[1::3].T, hips.shape)
    fields = {name: value.shape[1:] for name, value in given.items() if hasattr(model, name)}
    step = substep(model, robot, fields, SINGLE)
    inputs, outputs = arguments(step)
    arrays = [given[each.name].reshape(each.shape(ROBOTS, STEPS)).astype(np.float32) for each in inputs]
    expected = [np.empty(each.shape(ROBOTS, STEPS), np.float32) for each in outputs]
    Program(step, STEPS)([np.ascontiguousarray(a) for a in arrays] + expected, 0, ROBOTS)

    # In memory the robots lie side by side, as the kernel's caller asks of JAX.
    memory = [np.ascontiguousarray(np.moveaxis(a, 0, -1)) for a in (*arrays, *expected)]
    results = memory[len(arrays) :]
    for result in results:
        result[:] = np.nan
    own, names = write(model, robot, fields, SINGLE), ", ".join(f"a[{k}]" for k in range(len(memory)))
    epilogue = EPILOGUE.replace("NAME", NAME).replace("ARGUMENTS", names)
    (tmp_path / "kernel.cpp").write_text(PRELUDE + kernel_source(own, STEPS, ROBOTS, BLOCK, 4) + epilogue)
    command = [COMPILER, "-O0", "-w", "-shared", "-fPIC", "-o", "kernel.so", "kernel.cpp"]
    subprocess.run(command, cwd=tmp_path, check=True)
    pointers = (ctypes.c_void_p * len(memory))(*(a.ctypes.data for a in memory))
    ctypes.CDLL(str(tmp_path / "kernel.so")).all(-(-ROBOTS * lanes_of(own) // BLOCK), BLOCK, pointers)
    for each, found, alone in zip(outputs, results, expected, strict=True):
        difference = np.abs(np.moveaxis(found, -1, 0) - alone).reshape(ROBOTS, -1).max(axis=1)
        # In single precision four iterations for an elliptic cone end at different points now and then.
        assert np.quantile(difference, 0.75 if exact else 1.0) < 1e-4 * np.abs(alone).max(), each.name


def test_limbs_that_differ_are_computed_by_one_thread(bodies: dict[str, Robot]) -> None:
    for kind, threads in ((FIVE, 1), (BIPED, 2), (SOLES, 1)):
        robot = bodies[kind]
        assert substep_by_threads(training_model(robot), robot, {}, SINGLE).limbs == threads, kind


def test_the_reason_why_no_kernel_can_be_called_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    reason = on_gpu.unavailable()
    assert not reason or "driver" in reason or "libnvrtc" in reason  # empty on a machine with a GPU
    monkeypatch.setattr(nvrtc, "library", lambda: None)
    for module, function, result, reason in (
        (driver, "capability", 90, ""), (driver, "capability", 75, "7.5"),
        (driver, "capability", DriverError("the driver is too old"), "too old"),
        (nvrtc, "library", NvrtcError("libnvrtc is not installed"), "libnvrtc"),
        (handler, "version", (1, 0), "version 1"),
    ):  # fmt: skip
        monkeypatch.setattr(module, function, Mock(side_effect=repeat(result)))
        assert reason in on_gpu.unavailable()
        assert bool(on_gpu.unavailable()) == bool(reason)


def test_a_kernel_is_compiled_once_and_stored_in_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    load, compile_code = Mock(return_value=5), Mock(return_value=b"code")
    monkeypatch.setattr(driver, "launch_address", lambda: 1)
    monkeypatch.setattr(driver, "load", load)
    monkeypatch.setattr(kernels, "_registered", {})
    launch = Launch(inputs=2, outputs=1, blocks=3, threads=64)
    for _ in range(2):
        kernels.register("stored", launch, compile_code)
    kernels.register("never_called", launch, compile_code, compile_now=False)
    taken = kernels.compiled()
    assert taken == [("stored", b"code", launch)]
    assert [call.args[0] for call in load.call_args_list] == [b"code"]
    kernels._registered.clear()
    stored = [taken[0]._replace(name="adopted")]  # where there is a GPU, XLA knows the other name for ever
    kernels.adopt(stored)
    assert kernels.compiled() == stored
    assert compile_code.call_count == 1


@contextmanager
def kernel(name: str, handle: int, loaded: int = 0) -> Iterator[tuple[Any, list[Any]]]:
    """A compiled program that calls a kernel for a + 2 b, four entries each, and its launches' arguments."""
    seen: list[Any] = []
    slot = ctypes.c_void_p(handle)

    def launch(kernel: int, *rest: Any) -> int:
        *grid, _, _, parameters, _ = rest
        seen.append((kernel, tuple(grid)))
        a, b, result = (ctypes.cast(parameters[k][0], ctypes.POINTER(ctypes.c_float)) for k in range(3))
        for k in range(4):
            result[k] = a[k] + 2.0 * b[k]
        return 0

    def wait() -> None:
        seen.append("waited")
        slot.value = loaded

    launcher, waiter = LAUNCHER(launch), ctypes.CFUNCTYPE(None)(wait)
    addresses = [handler.address_of(each) for each in (launcher, waiter)]
    kept, address = handler.compiled(
        Launch(2, 1, 5, 64), addresses[0], ctypes.addressof(slot), addresses[1], on_stream=False
    )
    jax.ffi.register_ffi_target(name, handler.capsule(address), platform="cpu")
    yield jax.jit(jax.ffi.ffi_call(name, jax.ShapeDtypeStruct((4,), jnp.float32))), seen
    del kept


def test_a_kernel_gets_its_arguments_in_order_and_the_first_call_waits_until_it_is_loaded() -> None:
    launched = (5, 1, 1, 64, 1, 1)
    for handle, loaded, expected in ((7, 0, [(7, launched)] * 2), (0, 9, ["waited", *[(9, launched)] * 2])):
        with kernel(f"handle_{handle}", handle, loaded) as (program, seen):
            for _ in range(2):
                result = program(jnp.arange(4, dtype=jnp.float32), jnp.ones(4))
                assert np.array_equal(result, [2.0, 3.0, 4.0, 5.0])
        assert seen == expected


def words(*values: int | None) -> Any:
    """A structure of XLA's interface with fields of eight bytes each."""
    return (ctypes.c_void_p * len(values))(*values)


def test_on_a_gpu_the_kernel_is_launched_on_xlas_stream() -> None:
    """The call's frame has the layout of `c_api.h`."""
    streams = []

    @LAUNCHER
    def launch(*given: Any) -> int:
        streams.append(given[8])
        return 0

    @ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.POINTER(ctypes.c_void_p))
    def get_stream(request: Any) -> None:
        assert request[2] == 77, "the execution's context"
        request[3] = 4711

    kept, address = handler.compiled(Launch(1, 0, 1, 32), handler.address_of(launch))
    data = ctypes.c_float(1.0)
    buffer = words(48, None, 11, ctypes.addressof(data), 1, None)
    inputs, types = words(ctypes.addressof(buffer)), words(1)
    interface = words(152, None, 24, None, 3 << 32, *[None] * 5, handler.address_of(get_stream), *[None] * 10)
    frame = words(
        168, None, ctypes.addressof(interface), 77, 3,
        40, None, 1, ctypes.addressof(types), ctypes.addressof(inputs),
        40, None, 0, None, None,
        40, None, 0, None, None, None, None,
    )  # fmt: skip
    function = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)(address)
    assert function(ctypes.addressof(frame)) is None
    assert streams == [4711]
    del kept

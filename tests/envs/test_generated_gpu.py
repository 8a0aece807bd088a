"""The kernel for GPUs computes the same as the program for processors.

If it cannot be called, the reason is named.
"""

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from made_up import BIPED, FIVE, SOLES
from physics_parity import STEPS, random_arguments

from footfall.envs.physics.generated import driver, handler, kernels, nvrtc, on_gpu
from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.cuda import NAME, kernel_source, lanes_of
from footfall.envs.physics.generated.driver import DriverError
from footfall.envs.physics.generated.handler import Launch
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
def test_the_kernel_computes_the_same_as_the_program_for_processors(
    name: str, write: Any, exact: bool, tmp_path: Path
) -> None:
    robot = load_robot(name)
    model = training_model(robot, exact_friction=exact)
    given = random_arguments(robot, model, ROBOTS, load_preset("gpu", robot).env.randomisation)
    given["qpos"][::2, 7::3] = _legs_that_meet(model, len(robot.joint_names) // 3)
    fields = {name: value.shape[1:] for name, value in given.items() if hasattr(model, name)}
    step = substep(model, robot, fields, SINGLE)
    inputs, outputs = arguments(step)
    arrays = [given[each.name].reshape(each.shape(ROBOTS, STEPS)).astype(np.float32) for each in inputs]
    expected = [np.empty(each.shape(ROBOTS, STEPS), np.float32) for each in outputs]
    Program(step, STEPS)([np.ascontiguousarray(a) for a in arrays] + expected, 0, ROBOTS)

    # In memory the robots lie side by side, as the kernel's caller asks of JAX.
    beside = [np.ascontiguousarray(np.moveaxis(a, 0, -1)) for a in (*arrays, *expected)]
    for result in beside[len(arrays) :]:
        result[:] = np.nan
    names = ", ".join(f"a[{k}]" for k in range(len(beside)))
    own = write(model, robot, fields, SINGLE)
    source = kernel_source(own, STEPS, ROBOTS, BLOCK, 4)
    text = PRELUDE + source + EPILOGUE.replace("NAME", NAME).replace("ARGUMENTS", names)
    (tmp_path / "kernel.cpp").write_text(text)
    library = tmp_path / "kernel.so"
    subprocess.run(
        [COMPILER, "-O0", "-w", "-shared", "-fPIC", "-o", library, tmp_path / "kernel.cpp"], check=True
    )
    pointers = (ctypes.c_void_p * len(beside))(*(a.ctypes.data for a in beside))
    ctypes.CDLL(str(library)).all(-(-ROBOTS * lanes_of(own) // BLOCK), BLOCK, pointers)
    for each, found, alone in zip(outputs, beside[len(arrays) :], expected, strict=True):
        difference = np.abs(np.moveaxis(found, -1, 0) - alone).reshape(ROBOTS, -1).max(axis=1)
        # In single precision four iterations for an elliptic cone end at different points now and then.
        assert np.quantile(difference, 0.75 if exact else 1.0) < 1e-4 * np.abs(alone).max(), each.name


def test_limbs_that_differ_are_computed_by_one_thread(bodies: dict[str, Robot]) -> None:
    for kind, threads in ((FIVE, 1), (BIPED, 2), (SOLES, 1)):
        robot = bodies[kind]
        assert substep_by_threads(training_model(robot), robot, {}, SINGLE).limbs == threads, kind


def _legs_that_meet(model: mujoco.MjModel, limbs: int) -> np.ndarray:
    """Angles of each leg's first joint, anywhere in its range."""
    lower, upper = model.jnt_range[1::3].T
    return np.random.default_rng(0).uniform(lower, upper, (-(-ROBOTS // 2), limbs))


def test_the_reason_why_no_kernel_can_be_called_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "driver" in on_gpu.unavailable() or "libnvrtc" in on_gpu.unavailable()  # there is no GPU here

    def missing(*_: object) -> None:
        raise NvrtcError("libnvrtc is not installed")

    def too_old(*_: object) -> None:
        raise DriverError("the driver is too old")

    monkeypatch.setattr(nvrtc, "library", lambda: None)
    monkeypatch.setattr(driver, "capability", lambda: 90)
    assert on_gpu.unavailable() == ""
    monkeypatch.setattr(driver, "capability", lambda: 75)
    assert "7.5" in on_gpu.unavailable()
    monkeypatch.setattr(driver, "capability", too_old)
    assert "too old" in on_gpu.unavailable()
    monkeypatch.setattr(nvrtc, "library", missing)
    assert "libnvrtc" in on_gpu.unavailable()
    monkeypatch.setattr(handler, "version", lambda: (1, 0))
    assert "version 1" in on_gpu.unavailable()


def test_a_kernel_is_compiled_once_and_stored_in_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded, compiled = [], []

    def compile_code() -> bytes:
        compiled.append("code")
        return b"code"

    monkeypatch.setattr(driver, "launch_address", lambda: 1)
    monkeypatch.setattr(driver, "load", lambda code, name, devices: loaded.append(code) or 5)
    monkeypatch.setattr(kernels, "_registered", {})
    launch = Launch(inputs=2, outputs=1, blocks=3, threads=64)
    for _ in range(2):
        kernels.register("stored", launch, compile_code)
    kernels.register("never_called", launch, compile_code, compile_now=False)
    assert kernels.compiled() == [("stored", b"code", launch)]
    assert (compiled, loaded) == (["code"], [b"code"])
    taken = kernels.compiled()
    kernels._registered.clear()
    kernels.adopt(taken)
    assert kernels.compiled() == taken
    assert compiled == ["code"]

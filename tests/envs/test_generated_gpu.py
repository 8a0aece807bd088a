"""The kernel for GPUs computes what the program for processors does; a missing way to call it is named."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from physics_parity import STEPS, random_arguments

from footfall.envs.physics.generated import driver, handler, kernels, nvrtc, on_gpu
from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.cuda import NAME, kernel_source
from footfall.envs.physics.generated.driver import DriverError
from footfall.envs.physics.generated.handler import Launch
from footfall.envs.physics.generated.llvm import Program
from footfall.envs.physics.generated.nvrtc import NvrtcError
from footfall.envs.physics.generated.substep import SINGLE, substep
from footfall.robots.description import load_robot
from footfall.robots.model import training_model
from footfall.train.config import load_preset

COMPILER = shutil.which("c++") or shutil.which("g++")
ROBOTS, BLOCK = 70, 64  # the last block is not full
# What CUDA's C has beyond C++; one thread after the other.
PRELUDE = """#include <cmath>
#define __global__
#define __restrict__
#define __launch_bounds__(threads, blocks)
struct Index { int x; } blockIdx, blockDim, threadIdx;
"""
EPILOGUE = """
extern "C" void all(int blocks, int threads, float** a) {
  blockDim.x = threads;
  for (blockIdx.x = 0; blockIdx.x < blocks; blockIdx.x++)
    for (threadIdx.x = 0; threadIdx.x < threads; threadIdx.x++) NAME(ARGUMENTS);
}
"""


@pytest.mark.skipif(COMPILER is None, reason="needs a C++ compiler")
def test_the_kernel_computes_the_same_as_the_program_for_processors(tmp_path: Path) -> None:
    robot = load_robot("go1")
    model = training_model(robot)
    given = random_arguments(robot, model, ROBOTS, load_preset("gpu", robot).env.randomisation)
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
    source = kernel_source(step, STEPS, ROBOTS, BLOCK, 4)
    text = PRELUDE + source + EPILOGUE.replace("NAME", NAME).replace("ARGUMENTS", names)
    (tmp_path / "kernel.cpp").write_text(text)
    library = tmp_path / "kernel.so"
    subprocess.run(
        [COMPILER, "-O0", "-w", "-shared", "-fPIC", "-o", library, tmp_path / "kernel.cpp"], check=True
    )
    pointers = (ctypes.c_void_p * len(beside))(*(a.ctypes.data for a in beside))
    ctypes.CDLL(str(library)).all(-(-ROBOTS // BLOCK), BLOCK, pointers)
    for each, found, wanted in zip(outputs, beside[len(arrays) :], expected, strict=True):
        scale = np.abs(wanted).max()
        assert np.abs(np.moveaxis(found, -1, 0) - wanted).max() < 1e-4 * scale, each.name


def test_where_no_kernel_can_be_called_the_reason_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_a_kernel_is_compiled_once_and_taken_along(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded, compiled = [], []

    def compile_code() -> bytes:
        compiled.append("code")
        return b"code"

    monkeypatch.setattr(driver, "launch_address", lambda: 1)
    monkeypatch.setattr(driver, "load", lambda code, name, devices: loaded.append(code) or 5)
    monkeypatch.setattr(kernels, "_registered", {})
    launch = Launch(inputs=2, outputs=1, blocks=3, threads=64)
    for _ in range(2):
        kernels.register("taken_along", launch, compile_code)
    kernels.register("never_called", launch, compile_code, at_once=False)
    assert kernels.compiled() == [("taken_along", b"code", launch)]
    assert (compiled, loaded) == (["code"], [b"code"])
    taken = kernels.compiled()
    kernels._registered.clear()
    kernels.adopt(taken)
    assert kernels.compiled() == taken
    assert compiled == ["code"]

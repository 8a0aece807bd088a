"""The kernel for GPUs computes what the program for processors does; a missing way to call it is named."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from physics_parity import STEPS, random_arguments

from footfall.envs.physics.generated import on_gpu
from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.cuda import NAME, kernel_source
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
def test_the_kernel_computes_what_the_processors_program_does(tmp_path: Path) -> None:
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
    assert "jaxlib" in on_gpu.unavailable()  # this machine's has no part for NVIDIA's GPUs

    from jaxlib import gpu_triton

    for name in ("TritonKernel", "TritonKernelCall", "create_array_parameter"):
        monkeypatch.setattr(gpu_triton, name, object, raising=False)
    monkeypatch.setattr(on_gpu, "library", lambda: None)
    monkeypatch.setattr(gpu_triton, "get_compute_capability", lambda _: 90, raising=False)
    assert on_gpu.unavailable() == ""
    monkeypatch.setattr(gpu_triton, "get_compute_capability", lambda _: 75, raising=False)
    assert "7.5" in on_gpu.unavailable()

    def missing() -> None:
        raise NvrtcError("libnvrtc is not installed")

    monkeypatch.setattr(on_gpu, "library", missing)
    assert "libnvrtc" in on_gpu.unavailable()

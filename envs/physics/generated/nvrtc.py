"""NVIDIA's run-time compiler, from CUDA C to machine code, by ctypes: it comes with JAX's CUDA extra."""

import ctypes
import ctypes.util
import sys
from functools import cache
from pathlib import Path
from typing import Any


class NvrtcError(Exception):
    """The compiler is missing or refuses the program; the message is the compiler's."""


@cache
def library() -> ctypes.CDLL:
    """The shared library; raises NvrtcError if there is none."""
    folders = [Path(entry) / "nvidia" for entry in sys.path if entry]
    paths = [path for folder in folders for path in sorted(folder.glob("*/lib/libnvrtc.so.*"))]
    names = [str(path) for path in paths if "alt" not in path.name]
    system_library = ctypes.util.find_library("nvrtc")
    for name in [*names, *([system_library] if system_library else [])]:
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    raise NvrtcError("NVIDIA's run-time compiler, libnvrtc, is not installed")


def compile_to_cubin(source: str, capability: int) -> bytes:
    """Machine code of CUDA C.

    Args:
        source: one translation unit.
        capability: compute capability of the GPU, 10 * major + minor.

    Raises:
        NvrtcError: there is no compiler, or the source is faulty.
    """
    nvrtc, program = library(), ctypes.c_void_p()
    options = [f"--gpu-architecture=sm_{capability}", "--std=c++17", "--use_fast_math"]
    encoded = (ctypes.c_char_p * len(options))(*(option.encode() for option in options))
    _check(nvrtc.nvrtcCreateProgram(ctypes.byref(program), source.encode(), b"physics.cu", 0, None, None))
    try:
        if nvrtc.nvrtcCompileProgram(program, len(options), encoded):
            log = _result(nvrtc.nvrtcGetProgramLogSize, nvrtc.nvrtcGetProgramLog, program)
            raise NvrtcError(log.rstrip(b"\0").decode(errors="replace"))
        return _result(nvrtc.nvrtcGetCUBINSize, nvrtc.nvrtcGetCUBIN, program)
    finally:
        nvrtc.nvrtcDestroyProgram(ctypes.byref(program))


def _check(status: int) -> None:
    if status:
        raise NvrtcError(f"NVIDIA's run-time compiler failed with status {status}")


def _result(size_of: Any, read: Any, program: ctypes.c_void_p) -> bytes:
    size = ctypes.c_size_t()
    _check(size_of(program, ctypes.byref(size)))
    content = ctypes.create_string_buffer(size.value)
    _check(read(program, content))
    return content.raw

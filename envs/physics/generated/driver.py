"""NVIDIA's driver, by ctypes: loads machine code and reports a GPU's compute capability."""

import ctypes
from collections.abc import Iterable
from functools import cache
from typing import Any

LIBRARY = "libcuda.so.1"
MAJOR, MINOR = 75, 76  # attributes of a device: its compute capability
NEEDED = ("cuLibraryLoadData", "cuLibraryGetKernel", "cuKernelGetFunction", "cuLaunchKernel")  # CUDA 12


class DriverError(Exception):
    """The driver is missing, too old, or failed."""


@cache
def library() -> ctypes.CDLL:
    """The shared library; raises DriverError if there is none, or an old one."""
    try:
        driver = ctypes.CDLL(LIBRARY)
    except OSError as error:
        raise DriverError(f"NVIDIA's driver is missing: {error}") from None
    missing = [name for name in NEEDED if not hasattr(driver, name)]
    if missing:
        raise DriverError(f"NVIDIA's driver is too old: it has no {missing[0]}")
    _check(driver.cuInit(0), "cuInit")
    return driver


def capability(device: int = 0) -> int:
    """Compute capability of a GPU, 10 * major + minor; raises DriverError."""
    major, minor = ctypes.c_int(), ctypes.c_int()
    for attribute, value in ((MAJOR, major), (MINOR, minor)):
        _check(library().cuDeviceGetAttribute(ctypes.byref(value), attribute, device), "cuDeviceGetAttribute")
    return 10 * major.value + minor.value


def load(code: bytes, name: str, devices: Iterable[int]) -> int:
    """Load a kernel; returns its handle for `cuLaunchKernel`.

    Args:
        code: machine code, for all of the devices.
        name: name of the kernel in the code.
        devices: GPUs to load it into now. The first launch may be too late, since XLA records launches and
            repeats them.

    Raises:
        DriverError: the driver refuses the code.
    """
    driver, module, kernel = library(), ctypes.c_void_p(), ctypes.c_void_p()
    _check(
        driver.cuLibraryLoadData(ctypes.byref(module), code, None, None, 0, None, None, 0),
        "cuLibraryLoadData",
    )
    _check(driver.cuLibraryGetKernel(ctypes.byref(kernel), module, name.encode()), "cuLibraryGetKernel")
    for device in devices:
        _load_into(device, kernel)
    assert kernel.value is not None
    return kernel.value


def _load_into(device: int, kernel: ctypes.c_void_p) -> None:
    driver, context, popped, function = library(), *(ctypes.c_void_p() for _ in range(3))
    _check(driver.cuDevicePrimaryCtxRetain(ctypes.byref(context), device), "cuDevicePrimaryCtxRetain")
    _check(driver.cuCtxPushCurrent_v2(context), "cuCtxPushCurrent")
    try:
        _check(driver.cuKernelGetFunction(ctypes.byref(function), kernel), "cuKernelGetFunction")
    finally:
        driver.cuCtxPopCurrent_v2(ctypes.byref(popped))


def launch_address() -> int:
    """Address of `cuLaunchKernel`."""
    address: Any = ctypes.cast(library().cuLaunchKernel, ctypes.c_void_p).value
    return int(address)


def _check(status: int, call: str) -> None:
    if status:
        raise DriverError(f"NVIDIA's driver failed: {call} returned {status}")

"""Kernels by the names with which JAX's programs call them.

A kernel is compiled in a thread of its own while the program around it is traced and compiled. A program that
is read from a file finds its kernels in that file (`envs/workarounds/program_cache.py`).
"""

import ctypes
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from threading import Lock, Thread
from typing import NamedTuple

import jax

from footfall.envs.physics.generated import driver, handler
from footfall.envs.physics.generated.cuda import NAME
from footfall.envs.physics.generated.handler import Launch


class Kernel(NamedTuple):
    """A compiled kernel: plain data, to be written to a file."""

    name: str
    code: bytes
    launch: Launch


class _Registered:
    """A kernel that programs can call, whether it is compiled yet or not."""

    def __init__(self, name: str, launch: Launch, compile_code: Callable[[], bytes]) -> None:
        self._name, self._launch, self._compile_code = name, launch, compile_code
        self._slot = ctypes.c_void_p(None)
        self._lock = Lock()
        self._kernel: Kernel | None = None
        self.begun = False
        self._wait = ctypes.CFUNCTYPE(None)(self.load)
        self._function, address = handler.compiled(
            launch,
            driver.launch_address(),
            ctypes.addressof(self._slot),
            handler.address_of(self._wait),
        )
        jax.ffi.register_ffi_target(name, handler.capsule(address), platform="CUDA")

    def load_in_background(self) -> None:
        """Load the kernel in a background thread; its first launch reports a failure."""
        with suppress(Exception):
            self.load()

    def load(self) -> Kernel:
        """The kernel, compiled and loaded."""
        self.begun = True
        with self._lock:
            if self._kernel is None:
                code = self._compile_code()
                devices = [device.local_hardware_id for device in jax.local_devices()]
                self._slot.value = driver.load(code, NAME, devices)
                self._kernel = Kernel(self._name, code, self._launch)
            return self._kernel


_registered: dict[str, _Registered] = {}
_registering = Lock()


def register(name: str, launch: Launch, compile_code: Callable[[], bytes], compile_now: bool = True) -> None:
    """Register a kernel for programs to call; does nothing if the name is registered.

    Args:
        name: identifies the kernel's code and number of robots.
        launch: launch parameters.
        compile_code: returns the kernel's machine code.
        compile_now: begin to compile the kernel now; if False, its first launch does.
    """
    with _registering:
        if name in _registered:
            return
        kernel = _registered[name] = _Registered(name, launch, compile_code)
        kernel.begun = compile_now
    if compile_now:
        Thread(target=kernel.load_in_background, name="load kernel").start()


def adopt(kernels: Iterable[Kernel]) -> None:
    """Register kernels that are compiled already."""
    for kernel in kernels:
        register(kernel.name, kernel.launch, partial(bytes, kernel.code))


def compiled() -> list[Kernel]:
    """All kernels of this process whose compilation has begun; waits for them."""
    return [kernel.load() for kernel in list(_registered.values()) if kernel.begun]

"""Kernels by the names under which JAX's programs call them.

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

    def load_beside(self) -> None:
        """Load it in a thread of its own; the first launch reports what failed."""
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


def register(name: str, launch: Launch, compile_code: Callable[[], bytes], at_once: bool = True) -> None:
    """Let programs call a kernel; does nothing if there is one of this name.

    Args:
        name: tells what the kernel computes, and how many robots it is for.
        launch: how it is launched.
        compile_code: gives its machine code.
        at_once: begin to compile it now; otherwise its first launch does.
    """
    with _registering:
        if name in _registered:
            return
        kernel = _registered[name] = _Registered(name, launch, compile_code)
        kernel.begun = at_once
    if at_once:
        Thread(target=kernel.load_beside, name="load kernel").start()


def adopt(kernels: Iterable[Kernel]) -> None:
    """Let programs call kernels that were compiled before."""
    for kernel in kernels:
        register(kernel.name, kernel.launch, partial(bytes, kernel.code))


def compiled() -> list[Kernel]:
    """The kernels of this process that were begun to be compiled, once they are."""
    return [kernel.load() for kernel in list(_registered.values()) if kernel.begun]

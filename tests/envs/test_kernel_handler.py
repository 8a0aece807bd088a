"""The function that launches a kernel, called by XLA itself, with a launcher in Python."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from footfall.envs.physics.generated import handler
from footfall.envs.physics.generated.handler import Launch

ENTRIES = 4
LAUNCHER = handler.LAUNCHER


@contextmanager
def kernel(name: str, handle: int, loaded: int = 0) -> Iterator[tuple[Any, list[Any]]]:
    """A compiled program that calls a kernel for a + 2 b, and the arguments of its launches."""
    seen: list[Any] = []
    slot = ctypes.c_void_p(handle)

    def launch(kernel: int, *rest: Any) -> int:
        *grid, _, _, parameters, _ = rest
        seen.append((kernel, tuple(grid)))
        a, b, result = (ctypes.cast(parameters[k][0], ctypes.POINTER(ctypes.c_float)) for k in range(3))
        for k in range(ENTRIES):
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
    shape = jax.ShapeDtypeStruct((ENTRIES,), jnp.float32)
    yield jax.jit(jax.ffi.ffi_call(name, shape)), seen
    del kept


def test_a_kernel_gets_its_arguments_in_order() -> None:
    with kernel("handler_in_order", 7) as (program, seen):
        result = program(jnp.arange(ENTRIES, dtype=jnp.float32), jnp.ones(ENTRIES))
    assert np.array_equal(result, [2.0, 3.0, 4.0, 5.0])
    assert seen == [(7, (5, 1, 1, 64, 1, 1))]


def test_the_first_call_waits_until_the_kernel_is_loaded() -> None:
    with kernel("handler_waits", 0, loaded=9) as (program, seen):
        for _ in range(2):
            jax.block_until_ready(program(jnp.zeros(ENTRIES), jnp.ones(ENTRIES)))
    assert [each if each == "waited" else each[0] for each in seen] == ["waited", 9, 9]


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

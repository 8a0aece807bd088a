"""Data-parallel training: environments are divided among all devices, everything else is on each of them."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from typing import Any

import jax
from jax.flatten_util import ravel_pytree
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec

from footfall.envs.workarounds.partitioner import avoid_crashing_partitioner
from footfall.train.checks import check_devices
from footfall.train.config import PpoConfig

AXIS = "devices"
EACH = PartitionSpec()  # the same on each device
DIVIDED = PartitionSpec(AXIS)  # along the first dimension
GPU_OPTIONS: dict[str, str | bool] = {
    # Kernels that need not wait for each other run beside each other: small batches do not fill a GPU.
    "xla_gpu_command_buffer_scheduling_mode": "CONCURRENT",
    # Choosing among Triton's matrix products takes a quarter of the compilation and gains next to nothing.
    "xla_gpu_enable_triton_gemm": False,
    # Sums in one order each, so that a seed gives the same bits again; it costs nothing measurable.
    "xla_gpu_exclude_nondeterministic_ops": True,
}  # figures in docs/results.md


def device_mesh(config: PpoConfig, count: int | None = None) -> Mesh:
    """Every device of every process, or the first few of them, along one axis.

    Raises:
        UserError: the environments cannot be divided among so many.
    """
    devices = jax.devices()[:count]
    check_devices(config, len(devices))
    if len(devices) > 1:
        avoid_crashing_partitioner()
    return jax.make_mesh((len(devices),), (AXIS,), (AxisType.Auto,), devices=devices)


def compiler_options(mesh: Mesh) -> dict[str, str | bool] | None:
    """What XLA is told besides its defaults when it compiles for these devices."""
    return GPU_OPTIONS if _on_gpus(mesh) else None


def worth_keeping(mesh: Mesh) -> bool:
    """Whether a program compiled for these devices is worth being kept as a whole.

    On a processor, tracing is a small part of a training; and a home may be shared by unlike processors.
    """
    return mesh.size == 1 and _on_gpus(mesh)


def _on_gpus(mesh: Mesh) -> bool:
    return mesh.devices.flat[0].platform == "gpu"


def shardings(specs: Any, mesh: Mesh) -> Any:
    """The shardings that a tree of `EACH` and `DIVIDED` stands for."""
    return jax.tree.map(
        lambda spec: NamedSharding(mesh, spec), specs, is_leaf=lambda node: isinstance(node, PartitionSpec)
    )


def place(tree: Any, where: Any) -> Any:
    """Put host arrays, the same in every process, where they belong.

    Args:
        tree: of arrays.
        where: a tree prefix of it with shardings at its leaves.
    """

    def put(sharding: NamedSharding, leaf: Any) -> jax.Array:
        return jax.make_array_from_callback(leaf.shape, sharding, lambda index: leaf[index])

    return jax.tree.map(lambda sharding, below: jax.tree.map(partial(put, sharding), below), where, tree)


def on_the_processor() -> AbstractContextManager[Any]:
    """Compute on the host's processor: for what is done once, a GPU's kernels take longer to choose."""
    try:
        processor = jax.local_devices(backend="cpu")[0]
    except RuntimeError:  # JAX_PLATFORMS names accelerators alone
        processor = None
    return jax.default_device(processor)


def mean_over_devices(count: int) -> Callable[[Any], Any]:
    """The mean of each float leaf over the devices, inside a function that runs on each of them.

    The leaves travel as one vector: one collective operation costs less than dozens of small ones.
    """
    if count == 1:
        return lambda tree: tree

    def mean(tree: Any) -> Any:
        vector, unravel = ravel_pytree(tree)
        return unravel(jax.lax.pmean(vector, AXIS))

    return mean

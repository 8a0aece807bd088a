"""Data-parallel training: each device has a share of the environments, and a copy of everything else."""

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
REPLICATED = PartitionSpec()  # the same on each device
SHARDED = PartitionSpec(AXIS)  # along the first dimension
SHARDED_ROLLOUT = PartitionSpec(None, AXIS)  # arrays (time, environment, ...)
GPU_OPTIONS: dict[str, str | bool] = {
    # Independent kernels run at the same time: small batches do not fill a GPU.
    "xla_gpu_command_buffer_scheduling_mode": "CONCURRENT",
    # Choosing among Triton's matrix products takes a quarter of the compilation and gains almost no speed.
    "xla_gpu_enable_triton_gemm": False,
    # Every sum has one order, so that a seed gives the same bits again. The cost is not measurable.
    "xla_gpu_exclude_nondeterministic_ops": True,
}  # figures in docs/results.md


def device_mesh(config: PpoConfig, count: int | None = None) -> Mesh:
    """Every device of every process, or the first `count` of them, along one axis.

    Raises:
        UserError: the environments cannot be divided among that many devices.
    """
    devices = jax.devices()[:count]
    check_devices(config, len(devices))
    if len(devices) > 1:
        avoid_crashing_partitioner()
    return jax.make_mesh((len(devices),), (AXIS,), (AxisType.Auto,), devices=devices)


def compiler_options(mesh: Mesh) -> dict[str, str | bool] | None:
    """XLA's options for these devices; None: its defaults."""
    return GPU_OPTIONS if _on_gpus(mesh) else None


def caches_programs(mesh: Mesh) -> bool:
    """Whether to cache whole compiled programs of these devices on disk, which saves tracing them.

    On a CPU, tracing is a small part of a training, and different CPUs may share a home folder. A program
    read from the disk runs on every device of its process, so there must be only one.
    """
    return mesh.size == jax.device_count() == 1 and _on_gpus(mesh)


def _on_gpus(mesh: Mesh) -> bool:
    return mesh.devices.flat[0].platform == "gpu"


def shardings(specs: Any, mesh: Mesh) -> Any:
    """The shardings that a tree of `REPLICATED` and `SHARDED` stands for."""
    return jax.tree.map(
        lambda spec: NamedSharding(mesh, spec), specs, is_leaf=lambda node: isinstance(node, PartitionSpec)
    )


def place(tree: Any, sharding_tree: Any) -> Any:
    """Put host arrays, which are the same in every process, on the devices.

    Args:
        tree: tree of arrays.
        sharding_tree: a tree prefix of `tree` with shardings at its leaves.
    """

    def put(sharding: NamedSharding, leaf: Any) -> jax.Array:
        return jax.make_array_from_callback(leaf.shape, sharding, lambda index: leaf[index])

    def put_all(sharding: NamedSharding, subtree: Any) -> Any:
        return jax.tree.map(partial(put, sharding), subtree)

    return jax.tree.map(put_all, sharding_tree, tree)


def on_cpu() -> AbstractContextManager[Any]:
    """Compute on the host's CPU. A GPU takes longer to choose kernels than to run them once."""
    try:
        processor = jax.local_devices(backend="cpu")[0]
    except RuntimeError:  # JAX_PLATFORMS names accelerators alone
        processor = None
    return jax.default_device(processor)


def mean_over_devices(count: int) -> Callable[[Any], Any]:
    """Returns a function that averages each float leaf over the devices; it runs inside `shard_map`.

    The leaves are sent as one vector: one collective operation costs less than dozens of small ones.
    """
    if count == 1:
        return lambda tree: tree

    def mean(tree: Any) -> Any:
        vector, unravel = ravel_pytree(tree)
        return unravel(_mean_of_two(vector) if count == 2 else jax.lax.pmean(vector, AXIS))

    return mean


def _mean_of_two(vector: jax.Array) -> jax.Array:
    """The mean over two devices, which exchange their vectors: one transfer; an all-reduce takes two."""
    other = jax.lax.ppermute(vector, AXIS, [(0, 1), (1, 0)])
    return 0.5 * (vector + other)

"""The older of XLA's partitioners for jax 0.11, whose Shardy crashes in footfall's training.

Reason: compiling a `shard_map` over MJX's accelerations for two devices ends in a segmentation fault inside
Shardy's pass over unused inputs (ManualComputationUnusedInputsPattern), seen with jax 0.11.2 on GPUs and on
virtual processors. jax 0.10.2 compiles the same program with Shardy, which is then used.
Upstream: no report of it was found; JAX is about to drop the older partitioner.
Remove it when a jax release no longer crashes: tests/envs/test_workarounds.py then fails where jax 0.11 is
installed.

The older partitioner aborts inside a `shard_map` at a sort of several arrays or of several rows ("Check
failed: !IsManualLeaf()"), depending on what XLA made of the code around it: `permutation` sorts single
arrays.
"""

import math

import jax
import jax.numpy as jnp

CRASHES_SINCE = (0, 11)


def avoid_crashing_partitioner() -> None:
    """Compile programs for several devices without Shardy, if Shardy would crash."""
    if jax.__version_info__ >= CRASHES_SINCE:
        jax.config.update("jax_use_shardy_partitioner", False)


def permutation(key: jax.Array, count: int) -> jax.Array:
    """The same as `jax.random.permutation(key, count)`, by sorts of a single array each.

    Its algorithm: sort by random keys of 32 bits, often enough that equal keys do not matter.
    """
    order = jnp.arange(count)
    for _ in range(math.ceil(3 * math.log(max(1, count)) / math.log(2**32 - 1))):
        key, subkey = jax.random.split(key)
        order = order[_stable_order(jax.random.bits(subkey, (count,)))]
    return order


def _stable_order(keys: jax.Array) -> jax.Array:
    """The order that sorts uint32 keys (n,), by radix sort: a number holds its position, too."""
    count = len(keys)
    position_bits = (count - 1).bit_length()
    position = jnp.arange(count, dtype=jnp.uint32)
    order = position
    for shift in range(0, 32, 32 - position_bits):
        digit = (keys[order] >> shift) << position_bits
        order = order[jnp.sort(digit | position) & ((1 << position_bits) - 1)]
    return order

"""Traces code of other libraries so that a GPU launches fewer kernels.

Reason: with a thousand robots a GPU takes longer to launch a kernel than to run it. Two fifths of the
kernels of MJX's step, and a third of those of brax's loss, are short loops or scatters (sums, insertions).
Here they are traced as plain operations, which XLA fuses with their neighbours. Results stay the same; sums
get a fixed order, which a scatter does not guarantee.
Upstream: on a GPU the host launches each iteration of a scan, https://github.com/jax-ml/jax/issues/2491.
Remove it when MJX and brax trace fewer loops by themselves: tests/envs/test_workarounds.py counts them.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

_SCAN, _SEGMENT_SUM, _INSERT = jax.lax.scan, jax.ops.segment_sum, jnp.insert
_TRACING = threading.RLock()  # a replacement holds for the whole process


@contextmanager
def fewer_kernels() -> Iterator[None]:
    """Within the context, scans are unrolled, and sums over legs and insertions avoid scatters.

    On a CPU nothing changes: there a kernel costs little, and a longer program takes longer to compile.
    """
    if jax.default_backend() == "cpu":
        yield
        return
    with _TRACING:
        originals = jax.lax.scan, jax.ops.segment_sum, jnp.insert
        assert originals == (_SCAN, _SEGMENT_SUM, _INSERT), "other code has replaced these functions"
        _replace(_unrolled, segment_sum, insert)
        try:
            yield
        finally:
            _replace(_SCAN, _SEGMENT_SUM, _INSERT)


def segment_sum(
    data: jax.Array, segment_ids: Any, num_segments: int | None = None, **options: Any
) -> jax.Array:
    """`jax.ops.segment_sum` without a scatter, if each row is a segment or all rows are one segment.

    This holds for legs: their links have one parent each, and the trunk is the parent of all hips.

    Args:
        data: shape (rows, ...).
        segment_ids: segment of each row, known while tracing if it is a NumPy array.
        num_segments: rows of the result.
        options: see JAX.

    Returns:
        Sums, shape (segments, ...).
    """
    if isinstance(segment_ids, np.ndarray) and num_segments is not None and not options:
        if np.array_equal(segment_ids, np.arange(num_segments)):
            return data
        if num_segments == 1 and not segment_ids.any():
            return data.sum(axis=0, keepdims=True)
    return _SEGMENT_SUM(data, segment_ids, num_segments, **options)


def insert(array: jax.Array, where: Any, values: Any, axis: int | None = None) -> jax.Array:
    """`jax.numpy.insert` without a scatter where one number is inserted into a vector."""
    if isinstance(where, int) and array.ndim == 1 and jnp.ndim(values) == 0:
        return jnp.concatenate([array[:where], jnp.asarray(values, array.dtype)[None], array[where:]])
    return _INSERT(array, where, values, axis)


def _replace(scan: Any, sums: Any, insertion: Any) -> None:
    jax.lax.scan, jax.ops.segment_sum, jnp.insert = scan, sums, insertion


def _unrolled(*args: Any, **options: Any) -> Any:
    return _SCAN(*args, **(options | {"unroll": True}))

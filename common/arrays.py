"""NumPy and JAX arrays: the library of an array, and fast indices."""

from collections.abc import Callable
from typing import Any

import numpy as np

Array = Any  # a NumPy or a JAX array

_clip: Callable[[Array, Array, Array], Array]
try:
    # `numpy.clip` calls this. For the few joints of a robot its checks take longer than the result.
    from numpy._core import umath

    _clip = umath.clip  # type: ignore[attr-defined]
except (ImportError, AttributeError):  # another NumPy version
    _clip = np.clip


def library(array: Array) -> Any:
    """The array's namespace. NumPy's own `__array_namespace__()` takes as long as a sum over joints."""
    return np if isinstance(array, np.ndarray) else array.__array_namespace__()


def clamped(value: Array, lower: Array, upper: Array) -> Array:
    """The value, at least `lower` and then at most `upper`. NumPy arrays take a third of `clip`'s time."""
    if isinstance(value, np.ndarray):
        return _clip(value, lower, upper)
    xp = value.__array_namespace__()
    return xp.minimum(xp.maximum(value, lower), upper)


def any_nonzero(values: np.ndarray) -> bool:
    """Whether any value of a boolean or integer array is not zero.

    For the few joints of a robot it takes a fifth of the time of `numpy.any`.
    """
    return bool(values.tobytes().strip(b"\0"))


def as_slice(indices: np.ndarray) -> slice | np.ndarray:
    """Rising, evenly spaced indices as a slice, which NumPy indexes faster; others unchanged."""
    gaps = np.diff(indices)
    step = int(gaps[0]) if len(gaps) else 1
    even = step > 0 and bool((gaps == step).all())
    return slice(int(indices[0]), int(indices[-1]) + 1, step) if even else indices


def single(values: Any) -> np.ndarray:
    """Values in single precision, on the host: JAX would compile a conversion on its device."""
    return np.asarray(values, dtype=np.float32)

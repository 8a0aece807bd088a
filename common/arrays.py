"""NumPy and JAX arrays: the library of an array, and fast indices."""

from typing import Any

import numpy as np

Array = Any  # a NumPy or a JAX array


def library(array: Array) -> Any:
    """The array's namespace. NumPy's own `__array_namespace__()` takes as long as a sum over joints."""
    return np if isinstance(array, np.ndarray) else array.__array_namespace__()


def as_slice(indices: np.ndarray) -> slice | np.ndarray:
    """Rising, evenly spaced indices as a slice, which NumPy indexes faster; others unchanged."""
    gaps = np.diff(indices)
    step = int(gaps[0]) if len(gaps) else 1
    even = step > 0 and bool((gaps == step).all())
    return slice(int(indices[0]), int(indices[-1]) + 1, step) if even else indices


def single(values: Any) -> np.ndarray:
    """Values in single precision, on the host: JAX would compile a conversion on its device."""
    return np.asarray(values, dtype=np.float32)
